// Walks through pages of `anyhit` in a browser: PAGE and COMPARE_PAGE are such files, of a launch of
// 160 x 90 pixels; the second compares it with a picture that differs in the pixel 120,70 alone.
// COMPUTE_PAGE is of shaders/pass/looking/compute, MODULE_PAGE of 512 invocations of a module without
// an image. CHROMIUM is the browser.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import { readFileSync } from "node:fs";
import { chromium } from "playwright-core";

const QUIET = [
  "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
  "--disable-background-networking", "--disable-component-update", "--disable-sync",
];
const AXE = readFileSync(new URL("node_modules/axe-core/axe.min.js", import.meta.url), "utf8");
const { PAGE, COMPARE_PAGE, COMPUTE_PAGE, MODULE_PAGE } = process.env;
const [PLAIN, COMPARE, COMPUTE, MODULE] =
  [PAGE, COMPARE_PAGE, COMPUTE_PAGE, MODULE_PAGE].map((path) => pathToFileURL(path).href);

let browser;
before(async () => {
  browser = await chromium.launch({ executablePath: process.env.CHROMIUM, args: QUIET });
});
after(() => browser.close());

// Opens a page; it must make no request and report no error.
async function opened(t, address, size = { width: 1400, height: 900 }) {
  const page = await browser.newPage({ viewport: size, bypassCSP: true });
  const faults = [];
  page.on("pageerror", (error) => faults.push(String(error)));
  page.on("console", (message) => message.type() === "error" && faults.push(message.text()));
  page.on("request", (request) => {
    if (!/^(file|data|blob):/.test(request.url())) faults.push(`a request of ${request.url()}`);
  });
  t.after(async () => {
    await page.close();
    assert.deepEqual(faults, []);
  });
  await page.goto(address);
  await page.waitForFunction(() => document.getElementById("numbers").rows.length > 0);
  return page;
}

const title = (page) => page.textContent("#pixel-title");
const box = (page, selector) => page.locator(selector).first().boundingBox();

// Whether the cursor is inside the frame that scrolls, and inside the window.
async function inSight(page) {
  const [cursor, frame] = [await box(page, ".cursor"), await box(page, ".scroll")];
  const { width, height } = page.viewportSize();
  const right = Math.min(frame.x + frame.width, width);
  const bottom = Math.min(frame.y + frame.height, height);
  return cursor.x >= frame.x - 1 && cursor.x + cursor.width <= right + 1
    && cursor.y >= Math.max(0, frame.y) - 1 && cursor.y + cursor.height <= bottom + 1;
}

test("a page opens with the worst pixel, its explanation and marks", async (t) => {
  const page = await opened(t, PLAIN);
  const worst = await page.textContent("#worst-list button");
  assert.equal(await title(page), `Pixel ${worst}`);
  assert.ok(await page.isVisible("#explanation"));
  assert.ok(await page.isHidden("#hint"));
  assert.ok(await page.isChecked("#marks"));
  assert.ok(await page.isVisible("canvas.marks"));
});

test("the selection stays in sight at every zoom, by keyboard and from the list", async (t) => {
  const page = await opened(t, PLAIN);
  for (const zoom of ["1", "4", "12", "32", "0"]) {
    await page.selectOption("#zoom", zoom);
    assert.ok(await inSight(page), `zoom ${zoom}`);
    await page.locator(".plane").first().focus();
    for (let step = 0; step < 6; step += 1) {
      await page.keyboard.press("Shift+ArrowLeft");
      await page.keyboard.press("Shift+ArrowDown");
      assert.ok(await inSight(page), `zoom ${zoom}, step ${step}`);
    }
    await page.locator("#worst-list button").nth(5).click();
    assert.ok(await inSight(page), `zoom ${zoom}, a worst pixel`);
  }
});

test("a change of size keeps the selection in the middle", async (t) => {
  const page = await opened(t, PLAIN);
  await page.fill("#x", "80");
  await page.fill("#y", "45");
  await page.click("#go button");
  await page.selectOption("#zoom", "32");
  const [cursor, frame] = [await box(page, ".cursor"), await box(page, ".scroll")];
  assert.ok(Math.abs(cursor.x + cursor.width / 2 - (frame.x + frame.width / 2)) < 20);
  assert.ok(Math.abs(cursor.y + cursor.height / 2 - (frame.y + frame.height / 2)) < 20);
});

test("a mark can be hit where a pixel is small", async (t) => {
  const page = await opened(t, PLAIN);
  await page.selectOption("#zoom", "1");
  const data = JSON.parse(await page.textContent("#data"));
  const pixels = data.explanations.pixels;
  // One that is far from the others, hit three points beside it.
  const far = ([a, b]) => Math.min(...pixels.filter(([x, y]) => x !== a || y !== b).map(([x, y]) => Math.max(Math.abs(x - a), Math.abs(y - b))));
  const [x, y] = pixels.find((pixel) => far(pixel) > 6);
  const plane = await box(page, ".plane");
  await page.mouse.click(plane.x + x + 3.5, plane.y + y + 0.5);
  assert.equal(await title(page), `Pixel ${x},${y}`);
  await page.uncheck("#marks");
  await page.mouse.click(plane.x + x + 3.5, plane.y + y + 0.5);
  assert.equal(await title(page), `Pixel ${x + 3},${y}`);
});

test("the ring of the focus is visible", async (t) => {
  const page = await opened(t, PLAIN);
  await page.locator("#zoom").focus();
  for (let step = 0; step < 12; step += 1) {
    await page.keyboard.press("Tab");
    if (await page.evaluate(() => document.activeElement.className === "plane")) break;
  }
  const outline = await page.locator(".scroll").first().evaluate((scroll) => getComputedStyle(scroll).outlineStyle);
  assert.equal(outline, "solid");
});

test("values are shown under the mouse, the wheel zooms and dragging moves", async (t) => {
  const page = await opened(t, PLAIN);
  await page.selectOption("#zoom", "8");
  const frame = await box(page, ".scroll");
  const at = [frame.x + frame.width / 2, frame.y + frame.height / 2];
  const under = () => page.evaluate(([x, y]) => {
    const plane = document.querySelector(".plane").getBoundingClientRect();
    return [(x - plane.left) / plane.width, (y - plane.top) / plane.height];
  }, at);
  await page.mouse.move(...at);
  await page.waitForFunction(() => /\d+,\d+ .*float RGBA( [\d.e-]+){4}/.test(document.getElementById("hover").textContent));
  const before = await under();
  await page.mouse.wheel(0, -100);
  await page.waitForFunction(() => document.getElementById("zoom").value === "12");
  const after = await under();
  assert.ok(Math.abs(before[0] - after[0]) < 0.01 && Math.abs(before[1] - after[1]) < 0.01, `${before} ${after}`);
  const selected = await title(page);
  const scrolled = () => page.locator(".scroll").first().evaluate((scroll) => [scroll.scrollLeft, scroll.scrollTop]);
  const [left, top] = await scrolled();
  await page.mouse.down();
  await page.mouse.move(at[0] + 40, at[1] + 30, { steps: 5 });
  await page.mouse.up();
  assert.deepEqual(await scrolled(), [left - 40, top - 30]);
  assert.equal(await title(page), selected);
});

test("explanations wrap on demand", async (t) => {
  const page = await opened(t, PLAIN);
  const overflows = () => page.locator("#explanation").evaluate((text) => text.scrollWidth > text.clientWidth);
  assert.ok(await overflows());
  await page.check("#wrap");
  assert.ok(!(await overflows()));
});

test("compared pictures are side by side, move together and switch in place", async (t) => {
  const page = await opened(t, COMPARE);
  const figures = await page.locator("figure").evaluateAll((all) => all.map((one) => one.getBoundingClientRect().toJSON()));
  assert.equal(figures.length, 3);
  assert.ok(figures.every((figure) => figure.top === figures[0].top && figure.right <= 1400));
  assert.equal(await title(page), "Pixel 120,70");
  await page.selectOption("#zoom", "12");
  await page.locator(".scroll").nth(1).evaluate((scroll) => scroll.scrollTo(700, 300));
  await page.waitForFunction(() => [...document.querySelectorAll(".scroll")].every((one) => one.scrollLeft === 700 && one.scrollTop === 300));
  const first = () => page.locator("figcaption").first().textContent();
  assert.equal(await first(), "found");
  await page.keyboard.press("f");
  assert.equal(await first(), "expected");
  await page.click("#flicker");
  assert.equal(await first(), "found");
});

test("the legend of a difference has its scale, of one hue", async (t) => {
  const page = await opened(t, COMPARE);
  assert.ok(await page.isVisible("#legend"));
  const ticks = await page.locator("#ticks span").allTextContents();
  assert.deepEqual([ticks[0], ticks.at(-1)], ["0", "60"]);
  const { layers } = JSON.parse(await page.textContent("#data"));
  const hues = layers.at(-1).legend.slice(1).map((colour) => {
    const [r, g, b] = colour.match(/\d+/g).map(Number);
    // All have most red and least blue: the hue is 60 (g - b) / (r - b) degrees.
    assert.ok(r > g && g > b, colour);
    return (60 * (g - b)) / (r - b);
  });
  assert.ok(Math.max(...hues) - Math.min(...hues) < 10, `${hues}`);
});

const rows = (page) => page.locator("#numbers tr").evaluateAll((all) => Object.fromEntries(all.map((row) => [row.cells[0].textContent, row.cells[1].textContent])));

// The red, green and blue that a frame shows at a pixel: of its exposed canvas, or of its image.
const colour = (page, x, y) => page.locator(".plane").first().evaluate((plane, [x, y]) => {
  const image = plane.querySelector("img");
  const exposed = plane.querySelector(".exposed");
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
  const paint = canvas.getContext("2d");
  paint.drawImage(exposed.hidden ? image : exposed, 0, 0);
  return Array.from(paint.getImageData(x, y, 1, 1).data.slice(0, 3));
}, [x, y]);

const exposedAt = (page, stops) => page.waitForFunction(
  (stops) => document.getElementById("stops").textContent === stops && document.querySelector(".exposed").hidden === (stops === "0.0 EV"),
  stops,
);

test("exposure doubles the numbers of a float image, by keys and with the slider", async (t) => {
  const page = await opened(t, COMPUTE);
  await page.check("input[value=picture]");
  await page.fill("#x", "0");
  await page.fill("#y", "1");
  await page.click("#go button");
  // The first pixel of row 1 is (0, 1/4, 0): 64 of 255, and twice that is 128.
  await page.waitForFunction(() => document.getElementById("pixel-title").textContent === "Invocation 0,1,0");
  await page.waitForFunction(() => document.getElementById("numbers").textContent.includes("0 0.25 0 1"));
  assert.equal((await rows(page))["picture, float RGBA"], "0 0.25 0 1");
  assert.deepEqual(await colour(page, 0, 1), [0, 64, 0]);
  await page.keyboard.press("e");
  await page.keyboard.press("e");
  await exposedAt(page, "+1.0 EV");
  assert.deepEqual(await colour(page, 0, 1), [0, 128, 0]);
  await page.keyboard.press("Shift+E");
  await page.keyboard.press("Shift+E");
  await page.keyboard.press("Shift+E");
  await page.keyboard.press("Shift+E");
  await exposedAt(page, "-1.0 EV");
  assert.deepEqual(await colour(page, 0, 1), [0, 32, 0]);
  // The greatest number is 12, in column 12: 12 / 2^3.6 = 0.9896, and log2(12) = 3.58.
  await page.keyboard.press("n");
  await exposedAt(page, "-3.6 EV");
  assert.deepEqual(await colour(page, 12, 0), [252, 0, 0]);
  await page.keyboard.press("r");
  await exposedAt(page, "0.0 EV");
  assert.deepEqual(await colour(page, 12, 0), [255, 0, 0]);
  await page.locator("#exposure").focus();
  for (let step = 0; step < 10; step += 1) await page.keyboard.press("ArrowRight");
  await exposedAt(page, "+1.0 EV");
  // A heat map has no exposure.
  await page.check("input[value=instructions]");
  await page.waitForFunction(() => document.querySelector(".exposed").hidden && document.getElementById("exposure").disabled);
});

test("exposure of an 8-bit picture decodes its pixels", async (t) => {
  const page = await opened(t, COMPARE);
  // The expected picture is a PNG.
  await page.keyboard.press("f");
  await page.waitForFunction(() => document.querySelector("figcaption").textContent === "expected");
  const before = await colour(page, 80, 45);
  await page.keyboard.press("e");
  await page.keyboard.press("e");
  await exposedAt(page, "+1.0 EV");
  const { pictures } = JSON.parse(await page.textContent("#data"));
  assert.equal(pictures[1].floats, null);
  // sRGB as IEC 61966-2-1 defines it.
  const decode = (byte) => (byte / 255 <= 0.04045 ? byte / 255 / 12.92 : ((byte / 255 + 0.055) / 1.055) ** 2.4);
  const encode = (number) => 255 * (number <= 0.0031308 ? 12.92 * number : 1.055 * number ** (1 / 2.4) - 0.055);
  const doubled = (byte) => Math.min(255, pictures[1].encoding === "srgb" ? encode(2 * decode(byte)) : 2 * byte);
  const after = await colour(page, 80, 45);
  assert.ok(before.some((byte) => byte > 0));
  after.forEach((byte, channel) => assert.ok(Math.abs(byte - doubled(before[channel])) <= 1, `${before} ${after}`));
});

test("exposure applies to found and expected, also where they switch", async (t) => {
  const page = await opened(t, COMPARE);
  await page.keyboard.press("e");
  await page.waitForFunction(() => [...document.querySelectorAll(".exposed")].map((one) => one.hidden).join() === "false,false,true");
  const found = await colour(page, 120, 70);
  await page.keyboard.press("f");
  await exposedAt(page, "+0.5 EV");
  const expected = await colour(page, 120, 70);
  assert.notDeepEqual(found, expected);
});

test("a page of a dispatch speaks of invocations", async (t) => {
  const page = await opened(t, COMPUTE);
  const layers = await page.locator("#layers input").evaluateAll((all) => all.map((one) => one.value));
  assert.deepEqual(layers, ["picture", "instructions", "divergence"]);
  await page.check("input[value=instructions]");
  const worst = await page.textContent("#worst-list button");
  assert.match(worst, /^\d+,\d+,0$/);
  assert.equal(await title(page), `Invocation ${worst}`);
  const command = await page.textContent("#command-text");
  assert.equal(command, `anyhit trace-one-ray shaders/pass/looking/compute/scene.toml --invocation ${worst}`);
  assert.ok(await page.isVisible("#explanation"));
  assert.equal(await page.textContent("#go button"), "Go to invocation");
  assert.equal(await page.getAttribute("#x", "max"), "12");
  assert.ok(await page.isHidden("#depth"));
  await page.goto(`${COMPUTE}#3,2,0`);
  await page.waitForFunction(() => document.getElementById("pixel-title").textContent === "Invocation 3,2,0");
});

test("a dispatch without an image has heat maps alone, in rows along workgroups", async (t) => {
  const page = await opened(t, MODULE);
  assert.equal(await page.locator("figure").count(), 1);
  assert.match(await page.textContent("#facts"), /no picture: the scene has no output image/);
  assert.ok(await page.isHidden("#exposing"));
  assert.ok(await page.isChecked("input[value=instructions]"));
  assert.ok(await page.isHidden("#command"));
  await page.fill("#x", "300");
  await page.click("#go button");
  assert.equal(await title(page), "Invocation 300,0,0");
  // 300 is 9 * 32 + 12, in rows of 32, of which there are 16.
  const place = await page.locator(".cursor").evaluate((cursor) => [cursor.style.left, cursor.style.top]);
  assert.deepEqual(place, ["37.5%", "56.25%"]);
});

const PAGES = [["page", PLAIN], ["compare page", COMPARE], ["compute page", COMPUTE], ["page of a module", MODULE]];
for (const [name, address] of PAGES) {
  for (const width of [1400, 480]) {
    test(`axe finds nothing on a ${name} of ${width} pixels`, async (t) => {
      const page = await opened(t, address, { width, height: 900 });
      await page.addScriptTag({ content: AXE });
      const { violations } = await page.evaluate(() => axe.run());
      assert.deepEqual(violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html).join(" ")}`), []);
    });
  }
}
