"""From truths and finding rows to figures with intervals; reads nothing else of the tool."""
