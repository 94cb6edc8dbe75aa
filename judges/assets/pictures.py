"""Compares the texels of generated pictures with those of Pillow, OpenImageIO and OpenEXR."""

import io
import random
from collections import Counter

import numpy as np
import OpenEXR
import OpenImageIO as oiio
from PIL import Image, ImageOps

import exr_files
import hdr_files
import jpeg_files
import png_files

# The most that texels of a JPEG file differ by: decoders round the inverse transform, the colours
# and the interpolation of chroma differently (T.81, A.3.3 and A.1; T.871, 7).
JPEG_TOLERANCE = 4


def read_with_openimageio(path):
    """The numbers of all channels by their names, as the file stores them."""
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    file = oiio.ImageInput.open(str(path), config)
    if file is None:
        raise RuntimeError(f"OpenImageIO: {oiio.geterror()}")
    spec = file.spec()
    channels = {}
    for at, name in enumerate(spec.channelnames):
        # All at once would have one type, and integers would be fractions.
        pixels = file.read_image(0, 0, at, at + 1, spec.channelformat(at))
        if pixels is None:
            raise RuntimeError(f"OpenImageIO: {file.geterror()}")
        channels[name] = pixels.reshape(spec.height, spec.width)
    return spec, channels


def of_four(channels):
    """Red, green, blue and alpha of one to four channels of integers."""
    planes = list(channels.values())
    opaque = np.full(planes[0].shape, np.iinfo(planes[0].dtype).max, planes[0].dtype)
    colors = planes[:1] * 3 if len(planes) < 3 else planes[:3]
    return np.dstack(colors + [planes[-1] if len(planes) in (2, 4) else opaque])


def png_witnesses(path, data, texels, kind):
    yield "OpenImageIO", of_four(read_with_openimageio(path)[1])
    # Pillow keeps eight of 16 bits, and compares the transparent grey of tRNS with scaled numbers of
    # two and four bits (PNG, 11.3.1.1: the number in tRNS is that of the file).
    if texels.dtype == np.uint8 and not ("type 0" in kind and "tRNS" in kind):
        yield "Pillow", np.array(Image.open(io.BytesIO(data)).convert("RGBA"))


def hdr_witnesses(path, texels, kind):
    # OpenImageIO does not read the older runs, and exchanges the two quarter turns: "+X +Y" is a
    # picture that is turned clockwise ("Radiance File Formats", the resolution string).
    if "older" in kind or "+X +Y" in kind or "-X -Y" in kind:
        return
    spec, channels = read_with_openimageio(path)
    stored = np.dstack([channels[name] for name in "RGB"]).astype(np.float32)
    picture = oiio.ImageBuf(oiio.ImageSpec(spec.width, spec.height, 3, "float"))
    picture.set_pixels(oiio.ROI(), stored)
    picture.specmod().attribute("Orientation", spec.getattribute("Orientation") or 1)
    turned = oiio.ImageBufAlgo.reorient(picture).get_pixels("float")
    yield "OpenImageIO", np.dstack([turned, np.ones(turned.shape[:2], np.float32)])


def exr_witnesses(path, what, names, data_window, display_window):
    spec, channels = read_with_openimageio(path)
    assert (spec.x, spec.y) == tuple(data_window[:2]), "the data window of OpenImageIO"
    yield "OpenImageIO", exr_files.shown(what, names, channels, data_window, display_window)
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    yield "OpenEXR", exr_files.shown(what, names, channels, data_window, display_window)


def differs(found, wanted):
    """The greatest difference; floats are equal in all bits, or both NaN."""
    if found.dtype == np.float32:
        same = (found.view(np.uint32) == wanted.view(np.uint32)) | (np.isnan(found) & np.isnan(wanted))
        return 0 if same.all() else np.inf
    return int(np.abs(found.astype(int) - wanted.astype(int)).max())


class Picture:
    """A generated file with what the generator and the witnesses say of it."""

    def __init__(self, folder, number, seed):
        self.seed = seed
        own = random.Random(seed)
        kind = own.choice(["png", "jpg", "exr", "exr", "hdr"])
        self.path = folder / f"{number}.{kind}"
        self.tolerance, self.judged = 0, []
        if kind == "jpg":
            data, self.what = jpeg_files.generate(own)
            self.path.write_bytes(data)
            picture = ImageOps.exif_transpose(Image.open(io.BytesIO(data)))
            self.judged = [("Pillow", np.array(picture.convert("RGBA")))]
            self.tolerance = JPEG_TOLERANCE
        elif kind == "png":
            data, texels, self.what = png_files.generate(own)
            self.path.write_bytes(data)
            self.judged = [("the generator", texels), *png_witnesses(self.path, data, texels, self.what)]
        elif kind == "hdr":
            data, texels, self.what = hdr_files.generate(own)
            self.path.write_bytes(data)
            self.judged = [("the generator", texels), *hdr_witnesses(self.path, texels, self.what)]
        elif own.random() < 0.3:
            what, names, window, self.what = exr_files.generate_with_library(own, self.path)
            self.judged = list(exr_witnesses(self.path, what, names, window, window))
        else:
            data, texels, what, names, windows, self.what = exr_files.generate(own)
            self.path.write_bytes(data)
            self.judged = [("the generator", texels), *exr_witnesses(self.path, what, names, *windows)]
        self.judged = [(witness, np.ascontiguousarray(texels)) for witness, texels in self.judged]

    @property
    def saved_kind(self):
        """What the program saves the texels as: floats without a change, others in 8 bits."""
        return "exr" if self.path.suffix in (".exr", ".hdr") else "png"

    def check_saved(self, found, path):
        """Compares a file that the program saved with the texels that it holds."""
        dtype, shape = self.judged[0][1].dtype, self.judged[0][1].shape
        wanted = np.frombuffer(found, dtype).reshape(shape)
        if self.saved_kind == "exr":
            with OpenEXR.File(str(path), separate_channels=True) as file:
                by_openexr = {name: channel.pixels for name, channel in file.channels().items()}
            readers = {"OpenEXR": by_openexr, "OpenImageIO": read_with_openimageio(path)[1]}
            saved = {reader: np.dstack([channels[name] for name in "RGBA"]) for reader, channels in readers.items()}
        elif dtype == np.uint8:
            file = Image.open(path)
            if "srgb" not in file.info or abs(file.info["gamma"] - 1 / 2.2) > 1e-5:
                return "the saved PNG has no chunks sRGB and gAMA"
            saved = {"Pillow": np.array(file)}
        else:
            return None
        for reader, texels in saved.items():
            if differs(np.ascontiguousarray(texels), wanted):
                return f"{reader} reads other texels of the saved file"
        return None

    def check(self, found):
        for witness, texels in self.judged:
            dtype = texels.dtype
            if len(found) != texels.nbytes:
                return f"{len(found)} bytes, but of {witness} {texels.nbytes}"
            difference = differs(np.frombuffer(found, dtype).reshape(texels.shape), texels)
            if difference > self.tolerance:
                return f"{difference} off what {witness} reads"
        return None


def judge(program, count, seed):
    """Compares so many pictures; returns how many differ."""
    failed, kinds, readers = 0, Counter(), Counter()
    for first in range(0, count, 50):
        pictures = [Picture(program.folder, at, f"{seed} {first + at}") for at in range(min(50, count - first))]
        files = program.pictures([one.path.name for one in pictures], [one.saved_kind for one in pictures])
        for picture, (found, saved) in zip(pictures, files):
            kinds[picture.path.suffix[1:]] += 1
            readers.update(witness for witness, _ in picture.judged)
            wrong = picture.check(found) or picture.check_saved(found, saved)
            if wrong:
                failed += 1
                print(f"picture {picture.seed}: {picture.what}: {wrong}")
    print(f"{count} pictures ({dict(kinds)}), {failed} differ from {dict(readers)}")
    return failed
