"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const [width, height] = data.extent;
  const by = (id) => document.getElementById(id);
  const add = (parent, tag, text) => {
    const child = parent.appendChild(document.createElement(tag));
    if (text !== undefined) child.textContent = text;
    return child;
  };
  const list = (parent, texts) => {
    parent.replaceChildren();
    texts.forEach((text) => add(parent, "li", text));
  };
  // Whole numbers with commas, others with three digits that count.
  const shown = (value) => {
    if (!Number.isFinite(value)) return String(value);
    if (Number.isInteger(value) || Math.abs(value) >= 1000) {
      return Math.round(value).toLocaleString("en");
    }
    return String(Number(value.toPrecision(3)));
  };

  async function inflated(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
  }

  // The shortest digits of a number as f32.
  const float = (value) => {
    const digits = [1, 2, 3, 4, 5, 6, 7, 8, 9].find((count) => Math.fround(value.toPrecision(count)) === value);
    return Object.is(value, -0) ? "-0" : String(digits ? Number(value.toPrecision(digits)) : value);
  };

  let selected = null;
  by("title").textContent = data.title;
  list(by("facts"), data.facts);

  // The invocations behind the pixels: their IDs are numbered in launch order, x fastest.
  const { word, size: [across, down, depth], stride, dimensions } = data.invocations;
  for (const place of document.querySelectorAll(".word")) place.textContent = word;
  const idOf = (x, y) => {
    const at = y * stride + x;
    return [at % across, Math.floor(at / across) % down, Math.floor(at / across / down)].slice(0, dimensions);
  };
  const pixelOf = (id) => {
    const [x, y, z] = [across, down, depth].map((side, axis) => Math.min(Math.max(id[axis] ?? 0, 0), side - 1));
    const at = (z * down + y) * across + x;
    return [at % stride, Math.floor(at / stride)];
  };

  // Pictures side by side: each in a frame that scrolls, with marks and a cursor over it. Without
  // pictures, one frame for the heat maps.
  const planes = (data.pictures.length > 0 ? data.pictures : [null]).map((picture) => {
    const figure = add(by("figures"), "figure");
    const name = picture ? picture.name : "heat map";
    const caption = add(figure, "figcaption", name);
    const scroll = add(figure, "div");
    scroll.className = "scroll";
    const plane = add(scroll, "div");
    plane.className = "plane";
    plane.tabIndex = 0;
    plane.setAttribute("role", "application");
    plane.setAttribute("aria-label", `${name}, ${width} by ${height} pixels`);
    const image = add(plane, "img");
    image.alt = name;
    if (picture) image.src = picture.png;
    const exposed = add(plane, "canvas");
    exposed.className = "exposed";
    exposed.hidden = true;
    const canvas = add(plane, "canvas");
    canvas.className = "marks";
    const cursor = add(plane, "div");
    cursor.className = "cursor";
    cursor.hidden = true;
    return { picture, caption, scroll, plane, image, exposed, canvas, cursor };
  });
  // Puts a picture or a layer in a frame.
  const put = (frame, { name, png }, picture) => {
    frame.picture = picture;
    frame.exposed.hidden = true;
    frame.image.src = png;
    frame.image.alt = name;
    frame.caption.textContent = name;
    expose();
  };
  document.querySelector("main").classList.toggle("compare", planes.length > 1);

  // Sizes: whole multiples of a pixel, or as wide as there is room.
  const FACTORS = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32];
  const zoom = by("zoom");
  const scale = (plane) => plane.getBoundingClientRect().width / width;
  const resize = () => {
    const factor = Number(zoom.value);
    for (const { scroll, plane, cursor } of planes) {
      scroll.style.width = factor ? "fit-content" : "100%";
      plane.style.width = factor ? `${width * factor}px` : "100%";
      plane.style.aspectRatio = `${width} / ${height}`;
      // Inside a large pixel, no edge of the picture cuts the cursor.
      cursor.classList.toggle("inside", scale(plane) >= 12);
    }
    drawMarks();
  };
  for (const factor of FACTORS) {
    const option = add(zoom, "option", `${factor}x`);
    option.value = String(factor);
  }
  add(zoom, "option", "fit").value = "0";

  // Scrolls every picture so that a pixel lies at a place of its frame: in the middle, or anywhere
  // inside if it is in sight already.
  const scrollTo = (x, y, centred) => {
    for (const { scroll, plane } of planes) {
      const size = scale(plane);
      const along = (at, length, from) => {
        const [begin, end] = [at * size, (at + 1) * size];
        const margin = Math.min(24, length / 4);
        if (centred || end > from + length || begin < from) return (begin + end - length) / 2;
        if (begin < from + margin) return begin - margin;
        if (end > from + length - margin) return end - length + margin;
        return from;
      };
      const left = along(x, scroll.clientWidth, scroll.scrollLeft);
      const top = along(y, scroll.clientHeight, scroll.scrollTop);
      scroll.scrollTo(left, top);
    }
  };
  // Scrolls the window so that the selected pixel of the first picture is in sight.
  const reveal = () => planes[0].cursor.scrollIntoView({ block: "nearest", inline: "nearest" });

  // The pixel at a point of the window.
  const pixelAt = (plane, clientX, clientY) => {
    const box = plane.getBoundingClientRect();
    const at = (offset, length, count) => Math.min(count - 1, Math.max(0, Math.floor((offset / length) * count)));
    return [at(clientX - box.left, box.width, width), at(clientY - box.top, box.height, height)];
  };
  // The pixel that a click means: the nearest explained one where its mark is hit.
  const MARK = 5;
  const REACH = 4;
  const clicked = (plane, clientX, clientY) => {
    const [x, y] = pixelAt(plane, clientX, clientY);
    if (!marked() || explained.has(`${x},${y}`)) return [x, y];
    const box = plane.getBoundingClientRect();
    const size = scale(plane);
    const far = ([a, b]) =>
      Math.max(Math.abs((a + 0.5) * size - (clientX - box.left)), Math.abs((b + 0.5) * size - (clientY - box.top)));
    const near = data.explanations.pixels.reduce((one, other) => (far(other) < far(one) ? other : one));
    return far(near) <= REACH ? near : [x, y];
  };

  let follows = false;
  for (const { scroll, plane } of planes) {
    // All pictures show the same part.
    scroll.addEventListener("scroll", () => {
      if (follows) return;
      follows = true;
      for (const other of planes) {
        if (other.scroll !== scroll) other.scroll.scrollTo(scroll.scrollLeft, scroll.scrollTop);
      }
      requestAnimationFrame(() => { follows = false; });
    });
    // A press that moves drags the picture; one that does not selects a pixel.
    let press = null;
    plane.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || event.pointerType === "touch") return;
      press = { x: event.clientX, y: event.clientY, left: scroll.scrollLeft, top: scroll.scrollTop, moved: false };
      plane.setPointerCapture(event.pointerId);
    });
    plane.addEventListener("pointermove", (event) => {
      hover(...pixelAt(plane, event.clientX, event.clientY));
      if (!press) return;
      const [dx, dy] = [event.clientX - press.x, event.clientY - press.y];
      press.moved ||= Math.hypot(dx, dy) > 4;
      if (press.moved) scroll.scrollTo(press.left - dx, press.top - dy);
    });
    plane.addEventListener("pointerleave", () => hover(null));
    // Where it ended; browsers round the place of a click.
    let release = null;
    plane.addEventListener("pointerup", (event) => {
      release = { x: event.clientX, y: event.clientY, dragged: Boolean(press?.moved) };
      press = null;
    });
    plane.addEventListener("pointercancel", () => { press = null; });
    plane.addEventListener("click", (event) => {
      plane.focus({ preventScroll: true });
      const { x, y, dragged } = release ?? { x: event.clientX, y: event.clientY, dragged: false };
      release = null;
      if (!dragged) select(...clicked(plane, x, y));
    });
    // The wheel zooms about the pixel under it.
    plane.addEventListener("wheel", (event) => {
      if (event.ctrlKey || event.deltaY === 0) return;
      const now = scale(plane);
      const next = event.deltaY < 0 ? FACTORS.find((factor) => factor > now + 1e-6) : FACTORS.findLast((factor) => factor < now - 1e-6);
      if (!next) return;
      event.preventDefault();
      const box = plane.getBoundingClientRect();
      const [x, y] = [(event.clientX - box.left) / now, (event.clientY - box.top) / now];
      const frame = scroll.getBoundingClientRect();
      zoom.value = String(next);
      resize();
      scroll.scrollTo(x * next - (event.clientX - frame.left), y * next - (event.clientY - frame.top));
    }, { passive: false });
    plane.addEventListener("keydown", (event) => {
      const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
      const step = steps[event.key];
      if (!step) return;
      event.preventDefault();
      const far = event.shiftKey ? 10 : 1;
      const [x, y] = selected ?? [0, 0];
      select(x + far * step[0], y + far * step[1]);
      reveal();
    });
  }

  // Marks of the pixels that are explained: outlines that stay large enough to be hit.
  const explained = new Map();
  (data.explanations?.pixels ?? []).forEach(([x, y], at) => explained.set(`${x},${y}`, at));
  const isWhole = explained.size === 0 || explained.size === width * height;
  by("marking").hidden = isWhole;
  const marked = () => !isWhole && by("marks").checked;
  function drawMarks() {
    for (const { canvas, plane } of planes) {
      canvas.hidden = !marked();
      if (!marked()) continue;
      const size = scale(plane);
      const dots = devicePixelRatio || 1;
      // Browsers refuse larger canvases.
      const limit = 8192;
      const [across, down] = [width, height].map((side) => Math.min(limit, Math.round(side * size * dots)));
      canvas.width = across;
      canvas.height = down;
      const paint = canvas.getContext("2d");
      const unit = across / width;
      const side = Math.max(unit, MARK * dots);
      for (const [x, y] of data.explanations.pixels) {
        const [left, top] = [(x + 0.5) * unit - side / 2, (y + 0.5) * unit - side / 2];
        // One light and one dark outline: one of them shows on any picture.
        paint.lineWidth = dots;
        paint.strokeStyle = "#000000";
        paint.strokeRect(left - dots, top - dots, side + 2 * dots, side + 2 * dots);
        paint.strokeStyle = "#ff9bff";
        paint.strokeRect(left, top, side, side);
      }
    }
  }
  const room = data.pictures.length > 1 ? 420 : 720;
  const factors = FACTORS.filter((factor) => factor * width <= room);
  zoom.value = String(factors.pop() ?? 0);
  resize();

  // Layers: the picture itself, and heat maps in its place.
  const layers = by("layers");
  const choose = (name, layer) => {
    const label = add(layers, "label");
    const input = add(label, "input");
    input.type = "radio";
    input.name = "layer";
    input.value = name;
    label.append(` ${name}`);
    input.addEventListener("change", () => show(layer));
    return input;
  };
  // The layer whose legend and worst pixels are shown.
  let legendLayer = null;
  const show = (layer) => {
    if (layer) put(planes[0], { name: layer.title, png: layer.png }, null);
    else put(planes[0], data.pictures[0], data.pictures[0]);
    // The legend of a picture of differences stays.
    legendLayer = layer ?? (planes.length > 1 ? data.layers.at(-1) : null);
    by("legend").hidden = !legendLayer;
    by("worst").hidden = !legendLayer || legendLayer.worst.length === 0;
    if (!legendLayer) return;
    listWorst(legendLayer);
    by("legend-title").textContent = legendLayer.title;
    const bar = by("bar");
    bar.style.background = `linear-gradient(to right, ${legendLayer.legend.join(", ")})`;
    const ticks = legendLayer.ticks.map(shown);
    bar.setAttribute("aria-label", `colours from ${ticks[0]} to ${ticks[ticks.length - 1]}`);
    by("ticks").replaceChildren();
    ticks.forEach((tick) => add(by("ticks"), "span", tick));
    list(by("legend-facts"), legendLayer.facts);
  };
  const listWorst = (layer) => {
    const last = layer.worst.at(-1);
    by("ties").hidden = layer.ties === 0;
    if (layer.ties > 0) {
      by("ties").textContent = `${shown(layer.ties)} more have ${shown(last[1])}; those listed are spread over the picture.`;
    }
    by("worst-list").replaceChildren();
    for (const [[x, y], value] of layer.worst) {
      const item = add(by("worst-list"), "li");
      const button = add(item, "button", idOf(x, y).join(","));
      button.type = "button";
      button.addEventListener("click", () => {
        select(x, y);
        reveal();
      });
      item.append(` ${shown(value)}`);
    }
  };
  const shows = [...data.pictures.slice(0, 1).map(({ name }) => [name, null]), ...data.layers.map((layer) => [layer.name, layer])];
  const inputs = shows.map(([name, layer]) => choose(name, layer));
  const begin = Math.max(0, shows.findIndex(([, layer]) => layer && layer.name === data.shown));
  layers.hidden = data.layers.length === 0;

  by("marks").addEventListener("change", () => drawMarks());
  zoom.addEventListener("change", () => {
    resize();
    if (selected) scrollTo(...selected, true);
  });
  addEventListener("resize", () => drawMarks());

  // Found and expected take each other's place in the first frame.
  const flicker = () => {
    if (planes.length < 2) return;
    const next = data.pictures[planes[0].picture === data.pictures[0] ? 1 : 0];
    put(planes[0], next, next);
  };
  by("flicker").hidden = planes.length < 2;
  by("flicker").addEventListener("click", flicker);
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches?.("input[type=number], select")) return;
    const key = event.key.toLowerCase();
    if (key === "f") flicker();
    if (by("exposing").hidden) return;
    if (key === "e") setStops(stops + (event.shiftKey ? -0.5 : 0.5));
    if (key === "n") normalize();
    if (key === "r") setStops(0);
  });

  by("wrap").addEventListener("change", () => by("explanation").classList.toggle("wrapped", by("wrap").checked));

  // What stands at a pixel: the numbers of pictures and layers.
  const planesOfNumbers = new Map();
  const numbersOf = (layer) => {
    if (!layer.values) return Promise.resolve(null);
    if (!planesOfNumbers.has(layer)) {
      const decoded = inflated(layer.values).then((buffer) => new DataView(buffer));
      planesOfNumbers.set(layer, decoded.catch(() => null));
    }
    return planesOfNumbers.get(layer);
  };
  const paints = new Map();
  // The pixels of a picture, in a canvas.
  const paintOf = (picture) => {
    if (!paints.has(picture)) {
      const image = new Image();
      image.src = picture.png;
      paints.set(picture, image.decode().then(() => {
        const canvas = document.createElement("canvas");
        canvas.width = width;
        canvas.height = height;
        const paint = canvas.getContext("2d", { willReadFrequently: true });
        paint.drawImage(image, 0, 0);
        return paint;
      }).catch(() => null));
    }
    return paints.get(picture);
  };
  const colourOf = async (picture, x, y) => {
    const paint = await paintOf(picture);
    return paint ? Array.from(paint.getImageData(x, y, 1, 1).data).join(" ") : null;
  };
  const planesOfFloats = new Map();
  // The numbers of an image of floats, by pixel; null for other images.
  const floatsOf = (picture) => {
    if (!picture.floats) return Promise.resolve(null);
    if (!planesOfFloats.has(picture)) {
      const joined = inflated(picture.floats.values).then((buffer) => {
        const count = buffer.byteLength / 4;
        const [planar, bytes] = [new Uint8Array(buffer), new Uint8Array(buffer.byteLength)];
        for (let byte = 0; byte < 4; byte += 1) {
          for (let at = 0; at < count; at += 1) bytes[4 * at + byte] = planar[byte * count + at];
        }
        const view = new DataView(bytes.buffer);
        return Float32Array.from({ length: count }, (_, at) => view.getFloat32(4 * at, true));
      });
      planesOfFloats.set(picture, joined.catch(() => null));
    }
    return planesOfFloats.get(picture);
  };

  // Exposure: the numbers of pictures times a power of two, encoded as the pictures are.
  const ENCODINGS = {
    srgb: {
      encode: (number) => (number <= 0.0031308 ? 12.92 * number : 1.055 * number ** (1 / 2.4) - 0.055),
      decode: (stored) => (stored <= 0.04045 ? stored / 12.92 : ((stored + 0.055) / 1.055) ** 2.4),
    },
    stored: { encode: (number) => number, decode: (stored) => stored },
  };
  const MOST_STOPS = 16;
  let stops = 0;
  // The numbers of a picture's red, green and blue, three a pixel.
  const planesOfColours = new Map();
  const coloursOf = (picture) => {
    if (!planesOfColours.has(picture)) {
      planesOfColours.set(picture, Promise.all([floatsOf(picture), paintOf(picture)]).then(([floats, paint]) => {
        const pixels = paint.getImageData(0, 0, width, height).data;
        const { decode } = ENCODINGS[picture.encoding];
        const ofByte = Float32Array.from({ length: 256 }, (_, byte) => decode(byte / 255));
        const numbers = new Float32Array(3 * width * height);
        const channels = floats ? Math.min(3, picture.floats.channels) : 3;
        for (let at = 0; at < width * height; at += 1) {
          for (let channel = 0; channel < channels; channel += 1) {
            numbers[3 * at + channel] = floats ? floats[picture.floats.channels * at + channel] : ofByte[pixels[4 * at + channel]];
          }
        }
        return { numbers, pixels };
      }));
    }
    return planesOfColours.get(picture);
  };
  const exposeIn = async (frame) => {
    const { picture, exposed } = frame;
    if (stops === 0 || !picture?.encoding) {
      exposed.hidden = true;
      return;
    }
    const own = stops;
    const { numbers, pixels } = await coloursOf(picture);
    if (own !== stops || picture !== frame.picture) return;
    const { encode } = ENCODINGS[picture.encoding];
    const factor = 2 ** stops;
    const image = new ImageData(new Uint8ClampedArray(pixels), width, height);
    for (let at = 0; at < width * height; at += 1) {
      const [red, green, blue] = [numbers[3 * at], numbers[3 * at + 1], numbers[3 * at + 2]];
      // NaN is magenta, as in the picture.
      const isNumber = red === red && green === green && blue === blue;
      image.data[4 * at] = isNumber ? Math.round(255 * encode(Math.max(0, factor * red))) : 255;
      image.data[4 * at + 1] = isNumber ? Math.round(255 * encode(Math.max(0, factor * green))) : 0;
      image.data[4 * at + 2] = isNumber ? Math.round(255 * encode(Math.max(0, factor * blue))) : 255;
    }
    exposed.width = width;
    exposed.height = height;
    exposed.getContext("2d").putImageData(image, 0, 0);
    exposed.hidden = false;
  };
  function expose() {
    const isExposed = planes.some(({ picture }) => picture?.encoding);
    for (const id of ["exposure", "normalize", "reset"]) by(id).disabled = !isExposed;
    planes.forEach((frame) => exposeIn(frame).catch(() => {}));
  }
  let exposure = 0;
  const setStops = (value) => {
    stops = Math.round(10 * Math.min(MOST_STOPS, Math.max(-MOST_STOPS, value))) / 10;
    by("exposure").value = stops;
    by("stops").textContent = `${stops > 0 ? "+" : ""}${stops.toFixed(1)} EV`;
    // The slider moves faster than large pictures are exposed.
    cancelAnimationFrame(exposure);
    exposure = requestAnimationFrame(expose);
  };
  // The exposure at which the greatest number of the first picture is about 1.
  const normalize = async () => {
    const { numbers } = await coloursOf(data.pictures[0]);
    const most = numbers.reduce((most, number) => (Number.isFinite(number) && number > most ? number : most), 0);
    if (most > 0) setStops(Math.floor(-10 * Math.log2(most)) / 10);
  };
  // Larger pictures take too much memory.
  by("exposing").hidden = data.pictures.length === 0 || width * height > 2 ** 24;
  by("exposure").addEventListener("input", () => setStops(by("exposure").valueAsNumber));
  by("normalize").addEventListener("click", normalize);
  by("reset").addEventListener("click", () => setStops(0));

  const texts = data.explanations
    ? inflated(data.explanations.texts).then((buffer) => JSON.parse(new TextDecoder().decode(buffer)))
    : Promise.resolve([]);
  texts.catch(() => {});

  // Names and values of a pixel.
  const rowsOf = async (x, y) => {
    const rows = [];
    for (const layer of data.layers) {
      const numbers = await numbersOf(layer);
      const value = numbers ? shown(numbers.getFloat32(4 * (y * width + x), true)) : "not in this page, which is large";
      rows.push([layer.title, value]);
    }
    for (const picture of data.pictures) {
      const [floats, colour] = [await floatsOf(picture), await colourOf(picture, x, y)];
      if (floats) {
        const { channels } = picture.floats;
        const first = channels * (y * width + x);
        const values = Array.from(floats.subarray(first, first + channels), float).join(" ");
        rows.push([`${picture.name}, float ${"RGBA".slice(0, channels)}`, values]);
      }
      // Under the mouse, floats say more.
      if (colour) rows.push([`${picture.name}, RGBA`, colour, Boolean(floats)]);
    }
    return rows;
  };
  let under = null;
  async function hover(x, y) {
    under = x === null ? null : `${x},${y}`;
    const own = under;
    if (own === null) {
      by("hover").textContent = "\u00a0";
      return;
    }
    const rows = await rowsOf(x, y);
    if (own !== under) return;
    const isShown = ([name, , isDetail]) =>
      !isDetail && !data.layers.some((layer) => layer.title === name && layer !== legendLayer);
    const values = rows.filter(isShown).map(([name, value]) => `${name} ${value}`);
    by("hover").textContent = [idOf(x, y).join(","), ...values].join("  \u00b7  ");
  }

  let nearest = null;
  let turn = 0;
  async function select(x, y) {
    x = Math.min(Math.max(x, 0), width - 1);
    y = Math.min(Math.max(y, 0), height - 1);
    selected = [x, y];
    by("hint").hidden = true;
    const own = ++turn;
    const id = idOf(x, y);
    ["x", "y", "z"].forEach((axis, at) => { by(axis).value = id[at] ?? 0; });
    history.replaceState(null, "", `#${id.join(",")}`);
    for (const { cursor } of planes) {
      cursor.hidden = false;
      cursor.style.left = `${(100 * x) / width}%`;
      cursor.style.top = `${(100 * y) / height}%`;
      cursor.style.width = `${100 / width}%`;
      cursor.style.height = `${100 / height}%`;
    }
    scrollTo(x, y, false);
    by("pixel-title").textContent = `${word[0].toUpperCase()}${word.slice(1)} ${id.join(",")}`;
    by("command").hidden = !data.command;
    if (data.command) by("command-text").textContent = data.command.join(id.join(","));

    const at = explained.get(`${x},${y}`);
    let text = null;
    let status = "";
    if (at !== undefined) {
      try {
        text = (await texts)[at];
      } catch {
        status = "This browser cannot unpack the explanations; the command prints the same text.";
      }
    } else if (data.explanations) {
      status = `This page explains ${data.explanations.which}. ${data.command ? `Run the command to explain this ${word}.` : ""}`;
    } else if (data.command) {
      status = `Run the command to explain this ${word}.`;
    }
    const rows = await rowsOf(x, y);
    if (own !== turn) return;
    by("wrapping").hidden = text === null;
    by("explanation").hidden = text === null;
    by("explanation").textContent = text ?? "";
    by("status").textContent = status;
    by("nearest").hidden = at !== undefined || explained.size === 0;
    if (!by("nearest").hidden) {
      const far = ([a, b]) => (a - x) ** 2 + (b - y) ** 2;
      nearest = data.explanations.pixels.reduce((one, other) => (far(other) < far(one) ? other : one));
      by("nearest").textContent = `Nearest explained ${word}: ${idOf(...nearest).join(",")}`;
    }
    by("numbers").replaceChildren();
    for (const [name, value] of rows) {
      const row = add(by("numbers"), "tr");
      add(row, "th", name).scope = "row";
      add(row, "td", value);
    }
  }

  // Invocations beyond a picture are not shown.
  by("x").max = (stride === across ? width : across) - 1;
  by("y").max = (stride === across && depth === 1 ? height : down) - 1;
  by("z").max = depth - 1;
  by("depth").hidden = depth === 1;
  by("go").addEventListener("submit", (event) => {
    event.preventDefault();
    select(...pixelOf(["x", "y", "z"].map((axis) => by(axis).valueAsNumber)));
  });
  by("copy").addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(by("command-text").textContent);
      by("status").textContent = "Copied.";
    } catch {
      getSelection().selectAllChildren(by("command-text"));
      by("status").textContent = "The command is selected.";
    }
  });

  by("nearest").addEventListener("click", () => {
    select(...nearest);
    reveal();
  });

  const fromAddress = () => {
    const found = /^#(\d+),(\d+)(?:,(\d+))?$/.exec(location.hash);
    return found ? pixelOf(found.slice(1).map((number) => Number(number ?? 0))) : null;
  };
  addEventListener("hashchange", () => {
    const pixel = fromAddress();
    if (pixel && String(pixel) !== String(selected)) select(...pixel);
  });
  inputs[begin].checked = true;
  show(shows[begin][1]);
  setStops(0);
  const first = fromAddress() ?? data.selected;
  if (first) select(...first);
})();
