"""Show notebooks as pages of the documentation site, a hook of MkDocs."""

import json
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files


def markdown(notebook: str) -> str:
    """Text of a notebook's page.

    Parameters
    ----------
    notebook : str
        The notebook, JSON.

    Returns
    -------
    str
        Markdown.
    """
    cells = [(cell["cell_type"], "".join(cell["source"])) for cell in json.loads(notebook)["cells"]]
    return "\n\n".join(f"```python\n{text}\n```" if kind == "code" else text for kind, text in cells) + "\n"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page for each notebook.

    Parameters
    ----------
    files : Files
        Files of the site.
    config : MkDocsConfig
        Its configuration.

    Returns
    -------
    Files
        With the pages.
    """
    for path in sorted(Path(config.docs_dir).glob("notebooks/*.ipynb")):
        text = markdown(path.read_text(encoding="utf-8"))
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content=text))
    return files
