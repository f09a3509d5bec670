"""Make figures and static HTML pages from the registry."""
