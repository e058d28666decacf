"""Pictures for people: what a picture shows as data (`data`), and the terminal, images and pages that draw it."""
