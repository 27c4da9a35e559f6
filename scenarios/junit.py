"""JUnit XML of a bench run: a test suite per stratum, a test case per scene, for the pages of CI systems."""

from xml.etree import ElementTree

from scenarios.bench import Trial


def junit_xml(trials: list[Trial], estimator: str) -> str:
    """Return the run as JUnit XML; a clip that is not right is a failure, a breakdown an error."""
    root = ElementTree.Element("testsuites", name=f"leakloc bench {estimator}")
    for stratum in dict.fromkeys(trial.stratum for trial in trials):
        rows = [trial for trial in trials if trial.stratum == stratum]
        suite = ElementTree.SubElement(
            root,
            "testsuite",
            name=stratum,
            tests=str(len(rows)),
            failures=str(sum(not trial.right and not trial.detail for trial in rows)),
            errors=str(sum(bool(trial.detail) for trial in rows)),
        )
        for trial in rows:
            case = ElementTree.SubElement(suite, "testcase", classname=f"bench.{stratum}", name=f"scene {trial.number}")
            if trial.detail:
                ElementTree.SubElement(case, "error", message=trial.codes[0]).text = _printable(trial.detail)
            elif not trial.right:
                ElementTree.SubElement(case, "failure", message=", ".join(c for c in trial.codes if c != "found"))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _printable(text: str) -> str:
    """XML 1.0 has no control characters, not even escaped."""
    return "".join(letter if letter.isprintable() or letter in "\n\t" else "?" for letter in text)
