"""Checks the JUnit and Cobertura reports of a folder: by the schema of Jenkins, whose path is the second
argument, by coverage-04.dtd, and by what pycobertura counts."""

import sys
from pathlib import Path

from lxml import etree
from pycobertura import Cobertura


def check_junit(report: Path, schema_file: str) -> None:
    schema = etree.XMLSchema(file=schema_file)
    tree = etree.parse(report)
    cases = tree.findall(".//testcase")
    # GitLab reads the attribute `file` of a test, which the schema does not have.
    for case in cases:
        assert Path(case.attrib.pop("file")).is_file()
    schema.assertValid(tree)
    root = tree.getroot()
    for kind in ["failure", "error"]:
        found = root.findall(f".//{kind}")
        assert found and int(root.get(f"{kind}s")) == len(found), kind
    assert int(root.get("tests")) == len(cases)
    print(f"JUnit: {len(cases)} tests")


def check_cobertura(report: Path) -> None:
    dtd = etree.DTD(str(Path(__file__).with_name("coverage-04.dtd")))
    tree = etree.parse(report)
    assert dtd.validate(tree), dtd.error_log
    root, cobertura = tree.getroot(), Cobertura(str(report))
    assert cobertura.total_statements() == int(root.get("lines-valid"))
    files = cobertura.files()
    # A line of which not all branches ran is a state of its own there.
    states = [state for name in files for _, state in cobertura.line_statuses(name)]
    partial = states.count("partial")
    assert partial > 0 and cobertura.total_hits() + partial == int(root.get("lines-covered"))
    assert cobertura.total_misses() == len(states) - cobertura.total_hits()
    assert abs(cobertura.line_rate() - (cobertura.total_hits() + partial) / len(states)) < 1e-3
    assert len(files) == len(set(files)) > 0
    assert all(Path(name).is_file() for name in files)
    print(f"Cobertura: {len(files)} files, {cobertura.total_statements()} lines")


folder = Path(sys.argv[1])
check_junit(folder / "junit.xml", sys.argv[2])
check_cobertura(folder / "coverage.xml")
