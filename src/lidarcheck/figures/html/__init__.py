"""Pages: a workflow, a release and a run of the gate as HTML, with their pictures and files."""
