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

/** A test, and where it stands: a path from the folder of the program, and a line from 1. */
export interface ListedTest {
  name: string;
  file: string;
  line: number;
}

/** What `anyhit test --list --format json` prints; no test where the text is no such list. */
export function testsOf(text: string): ListedTest[] {
  try {
    const list = JSON.parse(text) as { tests?: ListedTest[] };
    return Array.isArray(list.tests) ? list.tests : [];
  } catch {
    return [];
  }
}
