"""This folder has no tests for pytest: users run golden.py, and its processes run sitecustomize.py."""

collect_ignore_glob = ["*.py", "pinned/*"]
