"""Files of a spreadsheet, which people call .csv or put among the recordings."""

OLD_EXCEL = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
FIRST_PARTS = (b"[Content_Types].xml", b"_rels/", b"docProps/", b"xl/", b"mimetypeapplication/vnd.oasis.opendocument")


def refuse_spreadsheet(source):
    """ReadError where the first bytes are those of Excel or of an OpenDocument, whatever the file is called."""
    zipped = source.head[:4] == b"PK\x03\x04" and source.head[30:].startswith(FIRST_PARTS)
    if zipped or source.head.startswith(OLD_EXCEL):
        remedy = "Save it from the spreadsheet as CSV, text with separated columns"
        raise source.error("byte 0", "it is a spreadsheet's own file", remedy)
