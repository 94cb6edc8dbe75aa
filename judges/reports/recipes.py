"""Writes the recipes of docs/ci.md and docs/ci-recipes.md as files of a folder, as a project has them."""

import re
import sys
from pathlib import Path

import ruamel.yaml

PAGES = Path(__file__).resolve().parents[2] / "docs"
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def main() -> None:
    folder = Path(sys.argv[1])
    workflows = 0
    for page in ["ci.md", "ci-recipes.md", "scale.md"]:
        for language, text in FENCE.findall((PAGES / page).read_text("utf-8")):
            if language == "groovy":
                (folder / "Jenkinsfile").write_text(text)
            if language != "yaml":
                continue
            content = ruamel.yaml.YAML(typ="safe").load(text)
            if "stages" in content:
                (folder / ".gitlab-ci.yml").write_text(text)
            elif "repos" in content:
                (folder / ".pre-commit-config.yaml").write_text(text)
            elif "jobs" in content:
                workflows += 1
                # Parts of a workflow, where the page leaves the rest to the reader.
                head = "" if "on" in content or True in content else "on: push\n"
                for job in content["jobs"].values():
                    if "uses" not in job and "runs-on" not in job:
                        text = text.replace("    steps:\n", "    runs-on: ubuntu-latest\n    steps:\n")
                        break
                (folder / f"workflow-{workflows}.yml").write_text(head + text)
    names = [".gitlab-ci.yml", ".pre-commit-config.yaml", "Jenkinsfile", "workflow-4.yml"]
    missing = [name for name in names if not (folder / name).exists()]
    sys.exit(f"the pages have no {', '.join(missing)}" if missing else 0)


main()
