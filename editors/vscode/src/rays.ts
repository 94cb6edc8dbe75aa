/** The rays of a scene file: where each `[[ray]]` stands, and what debugs it. */

export interface RayEntry {
  /** The line of its header, from 0. */
  line: number;
  /** What a launch configuration says to debug it. */
  launch: { ray?: string | number[]; pixel?: number[]; pass?: string | number };
}

/** The numbers between brackets: `[0, 1.5, 5]`. */
function numbers(text: string | undefined): number[] | undefined {
  const inner = text?.match(/^\[(.*)\]$/)?.[1];
  if (inner === undefined) {
    return undefined;
  }
  const all = inner.split(",").map((part) => part.trim()).filter((part) => part !== "");
  const values = all.map(Number);
  return values.every(Number.isFinite) ? values : undefined;
}

/** A basic or literal string of one line. */
function string(text: string | undefined): string | undefined {
  if (text === undefined) {
    return undefined;
  }
  const literal = text.match(/^'([^']*)'$/)?.[1];
  if (literal !== undefined) {
    return literal;
  }
  try {
    const value: unknown = text.startsWith('"') ? JSON.parse(text) : undefined;
    return typeof value === "string" ? value : undefined;
  } catch {
    return undefined;
  }
}

/** A line without its comment: a `#` within quotes is none. */
function withoutComment(line: string): string {
  const found = line.match(/^(?:[^#"']|"(?:[^"\\]|\\.)*"|'[^']*')*/);
  return (found?.[0] ?? "").trim();
}

/**
 * The rays of a scene's text that can be debugged: those with a name, with a pixel, or with an
 * origin and a direction on a line each.
 */
export function raysOf(text: string): RayEntry[] {
  const rays: RayEntry[] = [];
  let keys: Map<string, string> | undefined;
  let header = 0;
  const finish = () => {
    if (keys === undefined) {
      return;
    }
    const name = string(keys.get("name"));
    const pixel = numbers(keys.get("pixel"));
    const [origin, direction] = [numbers(keys.get("origin")), numbers(keys.get("direction"))];
    const passText = keys.get("pass");
    const pass = string(passText) ?? (passText === undefined ? undefined : Number(passText));
    const launch: RayEntry["launch"] = {};
    if (name !== undefined) {
      launch.ray = name;
    } else if (pixel !== undefined) {
      launch.pixel = pixel;
    } else if (origin?.length === 3 && direction?.length === 3) {
      launch.ray = [...origin, ...direction];
    }
    if (launch.ray !== undefined || launch.pixel !== undefined) {
      if (pass !== undefined && !Number.isNaN(pass)) {
        launch.pass = pass;
      }
      rays.push({ line: header, launch });
    }
    keys = undefined;
  };
  text.split(/\r?\n/).forEach((raw, line) => {
    const content = withoutComment(raw);
    if (content.startsWith("[") && !content.includes("=")) {
      finish();
      if (/^\[\[\s*ray\s*\]\]$/.test(content)) {
        keys = new Map();
        header = line;
      }
      return;
    }
    const pair = content.match(/^([A-Za-z0-9_-]+)\s*=\s*(.*)$/);
    if (pair && keys) {
      keys.set(pair[1], pair[2]);
    }
  });
  finish();
  return rays;
}
