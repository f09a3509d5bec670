"""Raw files of one unit in, rows of the registry out: each chain joins the parts in one order."""
