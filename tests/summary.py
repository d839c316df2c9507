# SPDX-License-Identifier: Apache-2.0
"""summary.py FOLDER: counts passed and failed tests and lists the reasons of skipped tests, from the XML reports of googletest
and pytest."""

import pathlib
import sys
import xml.etree.ElementTree as xml
from collections import Counter


def read(path):
    """(passed, failed, reasons of the skipped) of one report."""
    passed, failed, skipped = 0, 0, Counter()
    for case in xml.parse(path).iter("testcase"):
        skip = case.find("skipped")
        if skip is not None:
            skipped[(skip.get("message") or skip.text or "no reason given").strip().splitlines()[-1]] += 1
        elif case.find("failure") is not None or case.find("error") is not None:
            failed += 1
        else:
            passed += 1
    return passed, failed, skipped


def main(folder):
    bad = False
    for language, pattern in (("C++", "*_test.xml"), ("Python", "pytest.xml")):
        reports = [read(path) for path in sorted(pathlib.Path(folder).glob(pattern))]
        passed, failed = sum(r[0] for r in reports), sum(r[1] for r in reports)
        skipped = sum((r[2] for r in reports), Counter())
        print(f"{language}: {passed} passed, {failed} failed, {skipped.total()} skipped")
        for reason, count in skipped.most_common():
            print(f"  {count} x {reason}")
        bad |= failed > 0 or not reports
    return bad


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
