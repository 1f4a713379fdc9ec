"""The order of the tests: the longest files first, so that at the end no worker is alone with one."""

LONGEST = ("tests/workflow/", "tests/verification/")


def pytest_collection_modifyitems(items):
    items.sort(key=lambda item: not item.nodeid.startswith(LONGEST))
