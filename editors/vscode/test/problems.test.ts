import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import * as fs from "node:fs";
import * as os from "node:os";
import * as path from "node:path";
import test from "node:test";

const program = process.env.ANYHIT ?? "anyhit";
const manifest = JSON.parse(fs.readFileSync(path.resolve(__dirname, "../../package.json"), "utf8"));

test("the problem matcher finds the errors of the program", () => {
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), "anyhit-problems-"));
  const file = path.join(folder, "scene.toml");
  fs.writeFileSync(file, "version = 1\nlaunc = [1, 1]\n");
  const { stdout, stderr } = spawnSync(program, ["test", file], { encoding: "utf8" });
  const lines = (stdout + stderr).split("\n");
  const patterns: { regexp: string }[] = manifest.contributes.problemMatchers[0].pattern;
  const [head, place] = patterns.map(({ regexp }) => new RegExp(regexp));
  const at = lines.findIndex((line) => head.test(line));
  assert.deepEqual(head.exec(lines[at])?.slice(1), ["error", "unknown key `launc`"]);
  assert.deepEqual(place.exec(lines[at + 1])?.slice(1), [file, "2", "1"]);
  fs.rmSync(folder, { recursive: true });
});

test("the schema of scenes is packed", () => {
  for (const { url } of manifest.contributes.tomlValidation) {
    const schema = JSON.parse(fs.readFileSync(path.resolve(__dirname, "../..", url), "utf8"));
    assert.equal(schema.definitions.SceneFile.type, "object");
  }
});
