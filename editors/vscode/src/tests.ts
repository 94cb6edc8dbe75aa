import { execFile } from "node:child_process";
import * as path from "node:path";
import * as vscode from "vscode";

import { Difference, TestResult, resultsOf, testsOf } from "./results";

/** What a run of the program has printed. */
interface Printed {
  stdout: string;
  stderr: string;
}

/** Runs the program in a folder. That tests fail is no error; that it cannot be started is one. */
function run(
  program: string,
  folder: string,
  parameters: string[],
  token: vscode.CancellationToken,
): Promise<Printed> {
  return new Promise((resolve, reject) => {
    const options = { cwd: folder, maxBuffer: 256 << 20 };
    const child = execFile(program, parameters, options, (error, stdout, stderr) => {
      if (error !== null && typeof error.code !== "number") {
        reject(error);
      } else {
        resolve({ stdout, stderr });
      }
    });
    token.onCancellationRequested(() => child.kill());
  });
}

/** Shows the tests of all workspace folders in the Test Explorer, and runs them. */
export function registerTests(program: (scope?: vscode.Uri) => string): vscode.Disposable {
  const controller = vscode.tests.createTestController("anyhit", "anyhit");
  const inFolder = new Map<string, vscode.WorkspaceFolder>();
  const paths = (folder: vscode.WorkspaceFolder): string[] =>
    vscode.workspace.getConfiguration("anyhit", folder.uri).get<string[]>("testPaths") ?? ["."];

  const find = async (token: vscode.CancellationToken): Promise<void> => {
    controller.items.replace([]);
    inFolder.clear();
    for (const folder of vscode.workspace.workspaceFolders ?? []) {
      if (folder.uri.scheme !== "file") {
        continue;
      }
      const listed = await run(
        program(folder.uri),
        folder.uri.fsPath,
        ["test", "--list", "--format", "json", ...paths(folder)],
        token,
      );
      for (const { name, file, line } of testsOf(listed.stdout)) {
        const id = `${folder.uri.toString()} ${name}`;
        const uri = vscode.Uri.file(path.resolve(folder.uri.fsPath, file));
        const item = controller.createTestItem(id, name, uri);
        item.range = new vscode.Range(line - 1, 0, line - 1, 0);
        controller.items.add(item);
        inFolder.set(id, folder);
      }
    }
  };

  const execute = async (
    request: vscode.TestRunRequest,
    token: vscode.CancellationToken,
  ): Promise<void> => {
    const all: vscode.TestItem[] = [];
    controller.items.forEach((item) => all.push(item));
    const wanted = (request.include ?? all).filter((item) => !request.exclude?.includes(item));
    const testRun = controller.createTestRun(request);
    for (const folder of new Set(wanted.map((item) => inFolder.get(item.id)))) {
      const items = wanted.filter((item) => inFolder.get(item.id) === folder);
      if (folder === undefined || token.isCancellationRequested) {
        items.forEach((item) => testRun.skipped(item));
        continue;
      }
      items.forEach((item) => testRun.started(item));
      // A filter takes all tests whose names contain it: results of others are left out.
      const filters = request.include === undefined ? [] : items.flatMap((item) => ["--filter", item.label]);
      try {
        const parameters = ["test", "--format", "json", ...filters, ...paths(folder)];
        const printed = await run(program(folder.uri), folder.uri.fsPath, parameters, token);
        const results = new Map(resultsOf(printed.stdout).map((one) => [one.name, one]));
        for (const item of items) {
          tell(testRun, folder, item, results.get(item.label), printed.stderr);
        }
      } catch (error) {
        const message = new vscode.TestMessage(String(error));
        items.forEach((item) => testRun.errored(item, message));
      }
    }
    testRun.end();
  };

  controller.refreshHandler = find;
  controller.resolveHandler = async (item) => {
    if (item === undefined) {
      await find(new vscode.CancellationTokenSource().token);
    }
  };
  controller.createRunProfile("Run", vscode.TestRunProfileKind.Run, execute, true);
  return controller;
}

function tell(
  testRun: vscode.TestRun,
  folder: vscode.WorkspaceFolder,
  item: vscode.TestItem,
  result: TestResult | undefined,
  stderr: string,
): void {
  const message = (difference: Difference): vscode.TestMessage => {
    const told = new vscode.TestMessage(difference.report || difference.message);
    if (difference.at) {
      const uri = vscode.Uri.file(path.resolve(folder.uri.fsPath, difference.at.file));
      told.location = new vscode.Location(uri, new vscode.Position(difference.at.line - 1, 0));
    }
    return told;
  };
  switch (result?.outcome) {
    case "passed":
    case "renewed":
    case "known_failure":
      testRun.passed(item);
      break;
    case "failed":
      testRun.failed(item, (result.differences ?? []).map(message));
      break;
    case "error":
      testRun.errored(item, result.error ? message(result.error) : new vscode.TestMessage(stderr));
      break;
    case undefined:
      testRun.errored(item, new vscode.TestMessage(stderr || "the test was not run"));
      break;
  }
}
