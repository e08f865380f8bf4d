"""A run of all tests is complete if nothing was skipped but what is listed."""

from skips import unlisted


def test_what_is_listed_may_be_skipped():
    assert unlisted(["could not import 'torch': No module named 'torch'", "one processor"]) == []


def test_what_is_promised_may_not():
    assert unlisted(["chromium is not installed", "could not import 'jax'", "one processor"]) == [
        "chromium is not installed",
        "could not import 'jax'",
    ]
