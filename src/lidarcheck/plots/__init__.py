"""Pictures for people: pages and images. The only importer of matplotlib."""
