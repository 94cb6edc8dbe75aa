import assert from "node:assert/strict";
import test from "node:test";

import { raysOf } from "../src/rays";
import { resultsOf, testsOf } from "../src/results";

test("each ray of a scene is found with what debugs it", () => {
  const text = [
    "version = 1",
    "[[ray]] # the first",
    'name = "up # not a comment"',
    "pixel = [1, 2]",
    'pass = "ao"',
    "[ray.expect]",
    "t = 3",
    "[[ray]]",
    "pixel = [4, 0] # in the middle",
    "",
    "[[ray]]",
    "origin = [0.5, 0.25, 0]",
    "direction = [0, 0, -1]",
    "pass = 1",
    "[[rays]]",
    'name = "another table"',
  ].join("\n");
  assert.deepEqual(raysOf(text), [
    { line: 1, launch: { ray: "up # not a comment", pass: "ao" } },
    { line: 7, launch: { pixel: [4, 0] } },
    { line: 10, launch: { ray: [0.5, 0.25, 0, 0, 0, -1], pass: 1 } },
  ]);
});

test("reports of tests are read, and what is none is no error", () => {
  const test = { name: "a/b::up", file: "a/b.test.toml", line: 7 };
  assert.deepEqual(testsOf(JSON.stringify({ version: 1, tests: [test] })), [test]);
  assert.deepEqual(testsOf("a/scene.toml\r\nb\n\n"), []);
  assert.equal(resultsOf('{"tests":[{"name":"a","outcome":"passed"}]}')[0].name, "a");
  assert.deepEqual(resultsOf("error: x"), []);
});
