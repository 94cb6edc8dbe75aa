import assert from "node:assert/strict";
import * as path from "node:path";
import test from "node:test";

import { DebugClient } from "@vscode/debugadapter-testsupport";

/** The repository's folder, from where the compiled test is. */
const root = path.resolve(__dirname, "../../../..");
const folder = path.join(root, "shaders/pass/debugger/swept-spheres");
const program = process.env.ANYHIT ?? "anyhit";

/** The client starts a program with the interpreter in front: here there is none. */
async function withClient(body: (client: DebugClient) => Promise<unknown>): Promise<void> {
  const client = new DebugClient(program, "dap", "anyhit", { cwd: root });
  await client.start();
  try {
    await body(client);
  } finally {
    await client.stop();
  }
}

const launch = { scene: path.join(folder, "scene.toml"), pixel: [0, 0] };

test("a breakpoint in the closest-hit shader is hit, with its locals", () =>
  withClient(async (client) => {
    const shader = path.join(folder, "main.rchit");
    await client.hitBreakpoint(launch, { path: shader, line: 14 });
    const stack = await client.stackTraceRequest({ threadId: 1 });
    assert.deepEqual(
      stack.body.stackFrames.map((frame) => frame.name),
      ["main [closest-hit]", "[OpTraceRayKHR]", "main [ray generation]"],
    );
    const scopes = await client.scopesRequest({ frameId: stack.body.stackFrames[0].id });
    const reference = scopes.body.scopes[0].variablesReference;
    const variables = await client.variablesRequest({ variablesReference: reference });
    assert.deepEqual(
      variables.body.variables.map(({ name, value }) => [name, value]),
      [
        ["size", "3"],
        ["axis", "(3, 0, 0)"],
      ],
    );
  }));

test("a ray runs to its end", () =>
  withClient((client) =>
    Promise.all([client.configurationSequence(), client.launch(launch), client.waitForEvent("terminated")]),
  ));
