"""The screen Blooming: two editors on the left (`table`, `settings`), and plots of what is selected on the right."""
