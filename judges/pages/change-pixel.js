// Changes the red of one pixel of a PNG by an amount: `node change-pixel.js IN OUT X Y AMOUNT`.
import { readFileSync, writeFileSync } from "node:fs";
import { PNG } from "pngjs";

const [from, to, ...numbers] = process.argv.slice(2);
const [x, y, amount] = numbers.map(Number);
const picture = PNG.sync.read(readFileSync(from));
const at = 4 * (y * picture.width + x);
picture.data[at] += picture.data[at] + amount <= 255 ? amount : -amount;
writeFileSync(to, PNG.sync.write(picture));
