"""Drawing: figures as text for a terminal, as PNG and as SVG. The only importer of matplotlib and plotext."""
