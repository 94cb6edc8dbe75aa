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

  by("title").textContent = data.title;
  list(by("facts"), data.facts);

  // Pictures side by side: each in a frame that scrolls, with marks and a cursor over it.
  const planes = data.pictures.map((picture) => {
    const figure = add(by("figures"), "figure");
    const caption = add(figure, "figcaption", picture.name);
    const scroll = add(figure, "div");
    scroll.className = "scroll";
    const plane = add(scroll, "div");
    plane.className = "plane";
    plane.tabIndex = 0;
    plane.setAttribute("role", "application");
    plane.setAttribute("aria-label", `${picture.name}, ${width} by ${height} pixels`);
    const image = add(plane, "img");
    image.alt = picture.name;
    image.src = picture.png;
    const canvas = add(plane, "canvas");
    canvas.width = width;
    canvas.height = height;
    canvas.hidden = true;
    const cursor = add(plane, "div");
    cursor.className = "cursor";
    cursor.hidden = true;
    plane.addEventListener("click", (event) => {
      const box = plane.getBoundingClientRect();
      select(
        Math.floor(((event.clientX - box.left) / box.width) * width),
        Math.floor(((event.clientY - box.top) / box.height) * height),
      );
      plane.focus({ preventScroll: true });
    });
    plane.addEventListener("keydown", (event) => {
      const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
      const step = steps[event.key];
      if (!step) return;
      event.preventDefault();
      const far = event.shiftKey ? 10 : 1;
      const [x, y] = selected ?? [0, 0];
      select(x + far * step[0], y + far * step[1]);
    });
    return { picture, caption, plane, image, canvas, cursor };
  });

  // Sizes: whole multiples of a pixel, or as wide as there is room.
  const zoom = by("zoom");
  const resize = () => {
    for (const { plane } of planes) {
      const factor = Number(zoom.value);
      plane.style.width = factor ? `${width * factor}px` : "100%";
      plane.style.aspectRatio = `${width} / ${height}`;
      plane.closest("figure").style.width = factor ? "" : "100%";
    }
  };
  for (const factor of [1, 2, 3, 4, 6, 8, 12, 16, 24, 32]) {
    const option = add(zoom, "option", `${factor}x`);
    option.value = String(factor);
  }
  add(zoom, "option", "fit").value = "0";
  const room = data.pictures.length > 1 ? 420 : 720;
  const factors = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32].filter((factor) => factor * width <= room);
  zoom.value = String(factors.pop() ?? (data.pictures.length > 1 ? 1 : 0));
  zoom.addEventListener("change", resize);
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
  const show = (layer) => {
    const first = planes[0];
    first.image.src = layer ? layer.png : first.picture.png;
    first.image.alt = layer ? layer.title : first.picture.name;
    first.caption.textContent = layer ? layer.title : first.picture.name;
    by("legend").hidden = !layer;
    by("worst").hidden = !layer || layer.worst.length === 0;
    if (!layer) return;
    by("legend-title").textContent = layer.title;
    const bar = by("bar");
    bar.style.background = `linear-gradient(to right, ${layer.legend.join(", ")})`;
    const ticks = layer.ticks.map(shown);
    bar.setAttribute("aria-label", `colours from ${ticks[0]} to ${ticks[ticks.length - 1]}`);
    by("ticks").replaceChildren();
    ticks.forEach((tick) => add(by("ticks"), "span", tick));
    list(by("legend-facts"), layer.facts);
    by("worst-list").replaceChildren();
    for (const [[x, y], value] of layer.worst) {
      const item = add(by("worst-list"), "li");
      const button = add(item, "button", `${x},${y}`);
      button.type = "button";
      button.addEventListener("click", () => select(x, y));
      item.append(` ${shown(value)}`);
    }
  };
  const inputs = [choose(data.pictures[0].name, null), ...data.layers.map((layer) => choose(layer.name, layer))];
  const begin = Math.max(0, 1 + data.layers.findIndex((layer) => layer.name === data.shown));
  inputs[begin].checked = true;
  show(begin > 0 ? data.layers[begin - 1] : null);
  layers.hidden = data.layers.length === 0;

  // Marks of the pixels that are explained.
  const explained = new Map();
  (data.explanations?.pixels ?? []).forEach(([x, y], at) => explained.set(`${x},${y}`, at));
  by("marking").hidden = explained.size === 0 || explained.size === width * height;
  by("marks").addEventListener("change", () => {
    for (const { canvas } of planes) {
      canvas.hidden = !by("marks").checked;
      const paint = canvas.getContext("2d");
      paint.fillStyle = "#ff00ff";
      data.explanations.pixels.forEach(([x, y]) => paint.fillRect(x, y, 1, 1));
    }
  });

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
  const colours = new Map();
  const colourOf = async (picture, x, y) => {
    if (!colours.has(picture)) {
      const image = new Image();
      image.src = picture.png;
      colours.set(picture, image.decode().then(() => {
        const canvas = document.createElement("canvas");
        canvas.width = width;
        canvas.height = height;
        const paint = canvas.getContext("2d", { willReadFrequently: true });
        paint.drawImage(image, 0, 0);
        return paint;
      }).catch(() => null));
    }
    const paint = await colours.get(picture);
    return paint ? Array.from(paint.getImageData(x, y, 1, 1).data).join(" ") : null;
  };
  const texts = data.explanations
    ? inflated(data.explanations.texts).then((buffer) => JSON.parse(new TextDecoder().decode(buffer)))
    : Promise.resolve([]);
  texts.catch(() => {});

  let selected = null;
  let nearest = null;
  let turn = 0;
  async function select(x, y) {
    x = Math.min(Math.max(x, 0), width - 1);
    y = Math.min(Math.max(y, 0), height - 1);
    selected = [x, y];
    const own = ++turn;
    by("x").value = x;
    by("y").value = y;
    history.replaceState(null, "", `#${x},${y}`);
    for (const { cursor } of planes) {
      cursor.hidden = false;
      cursor.style.left = `${(100 * x) / width}%`;
      cursor.style.top = `${(100 * y) / height}%`;
      cursor.style.width = `${100 / width}%`;
      cursor.style.height = `${100 / height}%`;
    }
    by("pixel-title").textContent = `Pixel ${x},${y}`;
    by("command").hidden = !data.command;
    if (data.command) by("command-text").textContent = `${data.command[0]} --pixel ${x},${y}${data.command[1]}`;

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
      status = `This page explains ${data.explanations.which}. Run the command to explain this pixel.`;
    } else if (data.command) {
      status = "Run the command to explain this pixel.";
    }
    const rows = [];
    for (const layer of data.layers) {
      const numbers = await numbersOf(layer);
      if (numbers) rows.push([layer.title, shown(numbers.getFloat32(4 * (y * width + x), true))]);
    }
    for (const picture of data.pictures) {
      const colour = await colourOf(picture, x, y);
      if (colour) rows.push([`${picture.name}, RGBA`, colour]);
    }
    if (own !== turn) return;
    by("explanation").hidden = text === null;
    by("explanation").textContent = text ?? "";
    by("status").textContent = status;
    by("nearest").hidden = at !== undefined || explained.size === 0;
    if (!by("nearest").hidden) {
      const far = ([a, b]) => (a - x) ** 2 + (b - y) ** 2;
      nearest = data.explanations.pixels.reduce((one, other) => (far(other) < far(one) ? other : one));
      by("nearest").textContent = `Nearest explained pixel: ${nearest.join(",")}`;
    }
    by("numbers").replaceChildren();
    for (const [name, value] of rows) {
      const row = add(by("numbers"), "tr");
      add(row, "th", name).scope = "row";
      add(row, "td", value);
    }
  }

  by("x").max = width - 1;
  by("y").max = height - 1;
  by("go").addEventListener("submit", (event) => {
    event.preventDefault();
    select(by("x").valueAsNumber, by("y").valueAsNumber);
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

  by("nearest").addEventListener("click", () => select(...nearest));

  const fromAddress = () => {
    const found = /^#(\d+),(\d+)$/.exec(location.hash);
    return found ? [Number(found[1]), Number(found[2])] : null;
  };
  addEventListener("hashchange", () => {
    const pixel = fromAddress();
    if (pixel && String(pixel) !== String(selected)) select(...pixel);
  });
  const first = fromAddress() ?? data.selected;
  if (first) select(...first);
})();
