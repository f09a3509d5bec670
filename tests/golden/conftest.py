"""Nothing here is a test of pytest: golden.py is run by hand, sitecustomize.py by the processes that it starts."""

collect_ignore_glob = ["*.py", "pinned/*"]
