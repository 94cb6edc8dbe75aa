/** What `anyhit test --format json` prints, as far as it is shown. */

export interface Difference {
  message: string;
  report: string;
  at?: { file: string; line: number } | null;
}

export interface TestResult {
  name: string;
  file: string;
  outcome: "passed" | "failed" | "error" | "known_failure" | "renewed";
  differences?: Difference[];
  error?: Difference;
  why?: string;
}

/** The results in a report; none where the text is no report. */
export function resultsOf(text: string): TestResult[] {
  try {
    const report = JSON.parse(text) as { tests?: TestResult[] };
    return Array.isArray(report.tests) ? report.tests : [];
  } catch {
    return [];
  }
}

/** The names that `anyhit test --list` prints. */
export function namesOf(text: string): string[] {
  return text.split(/\r?\n/).filter((line) => line.trim() !== "");
}
