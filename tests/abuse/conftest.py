"""The counts of what was tried stand at the end of a run."""

COUNTS = "counts"
"""The property of a test that holds them."""


def pytest_terminal_summary(terminalreporter):
    for outcome in ("passed", "failed"):
        for report in terminalreporter.getreports(outcome):
            for name, value in getattr(report, "user_properties", ()):
                if name == COUNTS:
                    terminalreporter.write_line(f"{report.nodeid}: {value}")
