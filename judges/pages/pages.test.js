// Walks through pages of `anyhit` in a browser: PAGE and COMPARE_PAGE are such files, of a launch of
// 160 x 90 pixels; the second compares it with a picture that differs in the pixel 120,70 alone.
// CHROMIUM is the browser.
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
const [PLAIN, COMPARE] = [process.env.PAGE, process.env.COMPARE_PAGE].map((path) => pathToFileURL(path).href);

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
  await page.waitForFunction(() => /\d+,\d+ .*RGBA \d+ \d+ \d+ \d+/.test(document.getElementById("hover").textContent));
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

for (const [name, address] of [["page", PLAIN], ["compare page", COMPARE]]) {
  for (const width of [1400, 480]) {
    test(`axe finds nothing on a ${name} of ${width} pixels`, async (t) => {
      const page = await opened(t, address, { width, height: 900 });
      await page.addScriptTag({ content: AXE });
      const { violations } = await page.evaluate(() => axe.run());
      assert.deepEqual(violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html).join(" ")}`), []);
    });
  }
}
