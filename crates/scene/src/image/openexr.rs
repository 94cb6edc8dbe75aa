//! OpenEXR pictures of any channels, through the crate `exr`.

use std::io::Cursor;

use exr::image::{Image, SpecificChannels};
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{ChannelDescription, Text};
use exr::prelude::traits::{ReadChannels, ReadLayers, ReadSpecificChannel, WritableImage, read};

use crate::image::decoded::{Decoded, Header, Numbers};
use crate::image::invalid;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::{InputLimits, contained};
use anyhit_engine::machine::format::Format;

/// The header of a file, and the channels that its texels are made of.
struct ExrFile {
    header: Header,
    /// The stored texels with all of their channels, which the decoder holds.
    stored: Header,
    channels: Channels,
    /// The place of the stored texels within the picture.
    offset: [i64; 2],
}

/// The channels of a picture.
#[derive(Debug, PartialEq)]
struct Channels {
    /// The names of red, green and blue, of which some may be missing, or of one grey channel.
    color: Vec<Option<Text>>,
    alpha: Option<Text>,
}

impl Channels {
    fn count(&self) -> usize {
        self.color.len() + usize::from(self.alpha.is_some())
    }

    /// The channels among those of a part of a file: of the layer without a name if it has
    /// colours, or else of the first one that has.
    fn of(all: &[ChannelDescription]) -> Result<Self> {
        let layer_of = |channel: &ChannelDescription| {
            channel.name.to_string().rsplit_once('.').map_or(String::new(), |(layer, _)| layer.to_owned())
        };
        let layers = || std::iter::once(String::new()).chain(all.iter().map(layer_of));
        let of_layer = |layer: &str| {
            let own: Vec<_> = all.iter().filter(|channel| layer_of(channel) == layer).collect();
            move |name: &str| {
                own.iter().copied().find(|channel| {
                    let own = channel.name.to_string();
                    own.rsplit('.').next().is_some_and(|own| own.eq_ignore_ascii_case(name))
                })
            }
        };
        let has_color = |layer: &String| {
            let find = of_layer(layer);
            ["R", "G", "B", "Y"].iter().any(|name| find(name).is_some())
        };
        let has_any = |layer: &String| all.iter().any(|channel| layer_of(channel) == *layer);
        let layer = layers().find(has_color).or_else(|| layers().find(has_any)).unwrap_or_default();
        let find = of_layer(&layer);
        let named = |names: [&str; 3]| names.map(&find);
        let alpha = find("A");
        let is_color = |found: &[Option<_>; 3]| found.iter().any(Option::is_some);
        let rgb = named(["R", "G", "B"]);
        let color = if is_color(&rgb) {
            rgb.to_vec()
        } else if let found @ [Some(_), Some(_), Some(_)] = named(["X", "Y", "Z"]) {
            found.to_vec()
        } else if let [Some(u), Some(v), _] = named(["U", "V", ""]) {
            vec![Some(u), Some(v), None]
        } else if find("RY").or(find("BY")).is_some() {
            return Err(invalid(
                "luminance with chroma (channels Y, RY, BY) of an OpenEXR file is not supported",
            )
            .note("convert the picture to the channels R, G, B"));
        } else {
            let others = all.iter().filter(|channel| layer_of(channel) == layer);
            let other = others.clone().find(|channel| alpha.is_none_or(|alpha| alpha.name != channel.name));
            vec![find("Y").or(other).or(alpha)]
        };
        let alpha = alpha.filter(|alpha| color != [Some(*alpha)]);
        let chosen = || color.iter().flatten().chain(&alpha);
        if let Some(channel) = chosen().find(|channel| channel.sampling != Vec2(1, 1)) {
            return Err(invalid(format!(
                "the subsampled channel `{}` of an OpenEXR file is not supported",
                channel.name
            )));
        }
        if chosen().next().is_none() {
            return Err(invalid("the OpenEXR file has no channels"));
        }
        let name = |channel: &ChannelDescription| channel.name.clone();
        Ok(Self { color: color.into_iter().map(|one| one.map(name)).collect(), alpha: alpha.map(name) })
    }
}

impl ExrFile {
    fn new(bytes: &[u8]) -> Result<Self> {
        let data = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
        let part = data.headers.first().ok_or_else(|| invalid("the OpenEXR file has no parts"))?;
        if part.deep {
            return Err(invalid("deep pictures of OpenEXR are not supported"));
        }
        let channels = Channels::of(&part.channels.list)?;
        let window = part.shared_attributes.display_window;
        let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
        let header = |size: Vec2<usize>, channels| Header {
            extent: [side(size.width()), side(size.height())],
            channels,
            width: 4,
            plausible: u64::MAX,
            copies: 1,
        };
        let stored = header(part.layer_size, part.channels.list.len());
        let header = header(window.size, channels.count());
        let (own, shown) = (part.own_attributes.layer_position, window.position);
        let offset = [i64::from(own.x()) - i64::from(shown.x()), i64::from(own.y()) - i64::from(shown.y())];
        Ok(Self { header, stored, channels, offset })
    }
}

/// What the header of a file says.
pub(super) fn header(bytes: &[u8]) -> Result<Header> {
    contained("exr", ErrorKind::InvalidImage, || ExrFile::new(bytes).map(|file| file.header))
}

/// Decodes the display window of the first part; texels outside of its data window are 0.
pub(super) fn decode(bytes: &[u8], wanted: Option<Format>, limits: &InputLimits) -> Result<Decoded> {
    contained("exr", ErrorKind::InvalidImage, || decode_window(bytes, wanted, limits))
}

fn decode_window(bytes: &[u8], wanted: Option<Format>, limits: &InputLimits) -> Result<Decoded> {
    let ExrFile { header, stored, channels, offset } = ExrFile::new(bytes)?;
    header.check(bytes.len() as u64, wanted, limits)?;
    stored.check(bytes.len() as u64, None, limits)?;
    let count = channels.count();
    let [width, height] = header.extent.map(|side| side as usize);
    let Channels { color, alpha } = channels;
    let is_grey = color.len() == 1;
    let has_alpha = alpha.is_some();
    // A name for a channel that no file has, which then has the default value.
    let mut names = color.into_iter().chain([None, None]).take(3).chain([alpha]).enumerate();
    let mut next = || {
        let (at, name) = names.next().unwrap_or_default();
        name.unwrap_or_else(|| Text::from(&*format!("\u{1}{at}")))
    };
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .optional(next(), 0.0_f32)
        .optional(next(), 0.0_f32)
        .optional(next(), 0.0_f32)
        .optional(next(), 1.0_f32)
        .collect_pixels(
            move |_, _| vec![0.0_f32; count * width * height],
            move |numbers: &mut Vec<f32>,
                  at: Vec2<usize>,
                  (red, green, blue, alpha): (f32, f32, f32, f32)| {
                let place = |at: usize, offset: i64, side: usize| {
                    usize::try_from(at as i64 + offset).ok().filter(|at| *at < side)
                };
                let x = place(at.x(), offset[0], width);
                let Some((x, y)) = x.zip(place(at.y(), offset[1], height)) else { return };
                let texel = &mut numbers[count * (y * width + x)..][..count];
                match is_grey {
                    true => texel[0] = red,
                    false => texel[..3].copy_from_slice(&[red, green, blue]),
                }
                if has_alpha {
                    texel[count - 1] = alpha;
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(broken)?;
    let numbers = Numbers::Floats(image.layer_data.channel_data.pixels);
    Ok(Decoded { extent: header.extent, channels: count, numbers })
}

fn broken(error: exr::error::Error) -> Error {
    let unread = invalid(format!("not a readable OpenEXR file: {error}"));
    match &error {
        exr::error::Error::NotSupported(what) if what.contains("compression") => {
            unread.note("help: save the picture with the compression ZIP or PIZ")
        }
        _ => unread,
    }
}

/// Encodes texels of four numbers.
pub(super) fn encode([width, height]: [u32; 2], numbers: &[f32]) -> Result<Vec<u8>> {
    let [width, height] = [width as usize, height as usize];
    let pixel = |at: Vec2<usize>| {
        let texel = &numbers[4 * (at.y() * width + at.x())..];
        (texel[0], texel[1], texel[2], texel[3])
    };
    let mut bytes = Cursor::new(Vec::new());
    let image = Image::from_channels((width, height), SpecificChannels::rgba(pixel));
    image.write().non_parallel().to_buffered(&mut bytes).map_err(|error| invalid(error.to_string()))?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::image::Picture;

    /// A box of texels: the lowest and the highest x and y.
    type Window = [[i32; 2]; 2];

    /// A file without compression by the layout of the OpenEXR documentation, "File Layout". The
    /// channels are in alphabetical order; each has the numbers of its rows.
    fn file(channels: &[(&str, &[f32])], data: Window, display: Window, sampling: i32) -> Vec<u8> {
        let attribute = |name: &str, kind: &str, value: &[u8]| {
            let length = (value.len() as u32).to_le_bytes();
            [name.as_bytes(), b"\0", kind.as_bytes(), b"\0", &length, value].concat()
        };
        let words = |numbers: &[i32]| numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
        let floats = |numbers: &[f32]| numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
        let channel = |(name, _): &(&str, &[f32])| {
            // A float is of kind 2; its sampling is that of x and y.
            [name.as_bytes(), b"\0", &words(&[2, 0, sampling, sampling])].concat()
        };
        let list = [channels.iter().flat_map(channel).collect(), vec![0]].concat();
        let header = [
            vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0],
            attribute("channels", "chlist", &list),
            attribute("compression", "compression", &[0]),
            attribute("dataWindow", "box2i", &words(data.as_flattened())),
            attribute("displayWindow", "box2i", &words(display.as_flattened())),
            attribute("lineOrder", "lineOrder", &[0]),
            attribute("pixelAspectRatio", "float", &floats(&[1.0])),
            attribute("screenWindowCenter", "v2f", &floats(&[0.0; 2])),
            attribute("screenWindowWidth", "float", &floats(&[1.0])),
            vec![0],
        ]
        .concat();
        let [[left, top], [right, bottom]] = data;
        let (width, height) = ((right - left + 1) as usize, (bottom - top + 1) as usize);
        let size = 4 * width * channels.len();
        let begin = header.len() + 8 * height;
        let offsets = (0..height).flat_map(|row| ((begin + row * (8 + size)) as u64).to_le_bytes());
        let rows = (0..height).flat_map(|row| {
            let numbers: Vec<f32> = channels
                .iter()
                .flat_map(|(_, numbers)| numbers[row * width..][..width].iter().copied())
                .collect();
            [words(&[top + row as i32, size as i32]), floats(&numbers)].concat()
        });
        [header, offsets.collect(), rows.collect()].concat()
    }

    const WINDOW: Window = [[0, 0], [1, 0]];

    fn texels(bytes: &[u8]) -> Result<Vec<[f32; 4]>> {
        let picture = Picture::decode(Path::new("a.exr"), bytes, None)?;
        let numbers: Vec<f32> = picture.numbers().iter().map(|x| *x as f32).collect();
        Ok(numbers.as_chunks().0.to_vec())
    }

    /// OpenImageIO reads files of each of these lists of channels.
    #[test]
    fn channels_of_any_names_are_read() {
        let (a, b, c, d) =
            (&[1.0_f32, 5.0][..], &[2.0_f32, 6.0][..], &[3.0_f32, 7.0][..], &[0.5_f32, 0.25][..]);
        for (channels, wanted) in [
            (&[("Y", a)][..], [[1., 1., 1., 1.], [5., 5., 5., 1.]]),
            (&[("Z", a)], [[1., 1., 1., 1.], [5., 5., 5., 1.]]),
            (&[("A", d), ("Y", a)], [[1., 1., 1., 0.5], [5., 5., 5., 0.25]]),
            (&[("A", d)], [[0.5, 0.5, 0.5, 1.], [0.25, 0.25, 0.25, 1.]]),
            (&[("R", a)], [[1., 0., 0., 1.], [5., 0., 0., 1.]]),
            (&[("G", b), ("R", a)], [[1., 2., 0., 1.], [5., 6., 0., 1.]]),
            (&[("A", d), ("B", c), ("G", b), ("R", a), ("Z", d)], [[1., 2., 3., 0.5], [5., 6., 7., 0.25]]),
            (&[("b", c), ("g", b), ("r", a)], [[1., 2., 3., 1.], [5., 6., 7., 1.]]),
            (&[("X", a), ("Y", b), ("Z", c)], [[1., 2., 3., 1.], [5., 6., 7., 1.]]),
            (&[("U", a), ("V", b)], [[1., 2., 0., 1.], [5., 6., 0., 1.]]),
            (&[("d.B", c), ("d.G", b), ("d.R", a)], [[1., 2., 3., 1.], [5., 6., 7., 1.]]),
            // The first layer with colours, and the one without a name before all others.
            (&[("Z", d), ("a.b.Y", a), ("c.Y", b)], [[1., 1., 1., 1.], [5., 5., 5., 1.]]),
            (&[("Y", a), ("a.Y", b)], [[1., 1., 1., 1.], [5., 5., 5., 1.]]),
        ] {
            assert_eq!(texels(&file(channels, WINDOW, WINDOW, 1)).unwrap(), wanted, "{channels:?}");
        }
    }

    #[test]
    fn the_picture_is_the_display_window() {
        // Of the data, x from 1 to 2 and y from -1 to 0, one texel is shown, at the right.
        let numbers = &[1.0, 2.0, 3.0, 4.0][..];
        let (data, display) = ([[1, -1], [2, 0]], [[0, 0], [1, 1]]);
        let opaque = texels(&file(&[("Y", numbers)], data, display, 1)).unwrap();
        assert_eq!(opaque, [[0., 0., 0., 1.], [3., 3., 3., 1.], [0., 0., 0., 1.], [0., 0., 0., 1.]]);
        let clear = texels(&file(&[("A", &[1.0; 4]), ("Y", numbers)], data, display, 1)).unwrap();
        assert_eq!(clear, [[0.; 4], [3., 3., 3., 1.], [0.; 4], [0.; 4]]);
    }

    /// The decoder allocates a row of the data window.
    #[test]
    fn the_data_window_is_within_the_limits() {
        let numbers = vec![1.0; 40_000];
        let error = texels(&file(&[("Y", &numbers)], [[0, 0], [39_999, 0]], WINDOW, 1)).unwrap_err();
        assert!(error.render().contains("image-side"), "{error}");
    }

    #[test]
    fn other_files_are_refused_by_name() {
        let refused = |channels: &[(&str, &[f32])], sampling| {
            let error = texels(&file(channels, WINDOW, WINDOW, sampling)).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::InvalidImage);
            error.to_string()
        };
        let one = &[1.0_f32, 2.0][..];
        assert!(refused(&[("BY", one), ("RY", one), ("Y", one)], 1).contains("channels Y, RY, BY"));
        let words = refused(&[("Y", one)], 2);
        assert!(words.contains("subsampl"), "{words}");
        let whole = file(&[("Y", one)], WINDOW, WINDOW, 1);
        // High-throughput JPEG 2000: the row has a byte less than without compression.
        let mut compressed = whole.clone();
        let name = b"compression\0compression\0\x01\0\0\0";
        let at = whole.windows(name.len()).position(|part| part == name).unwrap() + name.len();
        compressed[at] = 10;
        compressed[whole.len() - 12] = 7;
        compressed.pop();
        let error = texels(&compressed).unwrap_err();
        assert!(
            error.message().contains("compression") && error.notes()[0].contains("ZIP or PIZ"),
            "{error}"
        );
        for cut in 4..whole.len() {
            assert_eq!(texels(&whole[..cut]).unwrap_err().kind(), ErrorKind::InvalidImage, "{cut}");
        }
    }

    #[test]
    fn what_is_written_reads_back() {
        let numbers = [0.0, 1.5, -2.0, 0.5, f32::INFINITY, 1e-30, 7.0, 1.0];
        assert_eq!(texels(&encode([2, 1], &numbers).unwrap()).unwrap().as_flattened(), numbers);
    }
}
