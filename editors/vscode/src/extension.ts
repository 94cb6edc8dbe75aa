import * as path from "node:path";
import * as vscode from "vscode";

import { raysOf } from "./rays";
import { registerTests } from "./tests";

/** The program `anyhit`. */
export function program(scope?: vscode.Uri): string {
  return vscode.workspace.getConfiguration("anyhit", scope).get<string>("path") || "anyhit";
}

/** Starts `anyhit dap` for each session. */
class AdapterFactory implements vscode.DebugAdapterDescriptorFactory {
  createDebugAdapterDescriptor(session: vscode.DebugSession): vscode.DebugAdapterDescriptor {
    const folder = session.workspaceFolder?.uri;
    const options = folder?.scheme === "file" ? { cwd: folder.fsPath } : undefined;
    return new vscode.DebugAdapterExecutable(program(folder), ["dap"], options);
  }
}

/** Completes configurations: F5 in a scene file without any debugs its first ray. */
class Configurations implements vscode.DebugConfigurationProvider {
  resolveDebugConfiguration(
    _folder: vscode.WorkspaceFolder | undefined,
    configuration: vscode.DebugConfiguration,
  ): vscode.DebugConfiguration | undefined {
    if (configuration.type) {
      return configuration;
    }
    const document = vscode.window.activeTextEditor?.document;
    if (document === undefined || !isScene(document)) {
      return undefined;
    }
    return configurationOf(document, {});
  }
}

function isScene(document: vscode.TextDocument): boolean {
  return document.uri.scheme === "file" && document.fileName.endsWith(".toml");
}

function configurationOf(document: vscode.TextDocument, launch: object): vscode.DebugConfiguration {
  return {
    type: "anyhit",
    request: "launch",
    name: `Debug a ray of ${path.basename(path.dirname(document.fileName))}`,
    scene: document.fileName,
    stopOnEntry: true,
    ...launch,
  };
}

/** `Debug this ray` above each ray of a scene. */
class RayLenses implements vscode.CodeLensProvider {
  provideCodeLenses(document: vscode.TextDocument): vscode.CodeLens[] {
    return raysOf(document.getText()).map((ray) => {
      const range = new vscode.Range(ray.line, 0, ray.line, 0);
      const title = "Debug this ray";
      return new vscode.CodeLens(range, {
        title,
        command: "anyhit.debugRay",
        arguments: [document.uri, ray.launch],
      });
    });
  }
}

async function debugRay(uri: vscode.Uri, launch: object): Promise<void> {
  const document = await vscode.workspace.openTextDocument(uri);
  // What is read is the file.
  await document.save();
  const folder = vscode.workspace.getWorkspaceFolder(uri);
  await vscode.debug.startDebugging(folder, configurationOf(document, launch));
}

export function activate(context: vscode.ExtensionContext): void {
  const scenes: vscode.DocumentSelector = { scheme: "file", pattern: "**/*.toml" };
  context.subscriptions.push(
    vscode.debug.registerDebugAdapterDescriptorFactory("anyhit", new AdapterFactory()),
    vscode.debug.registerDebugConfigurationProvider("anyhit", new Configurations()),
    vscode.languages.registerCodeLensProvider(scenes, new RayLenses()),
    vscode.commands.registerCommand("anyhit.debugRay", debugRay),
    registerTests(program),
  );
}
