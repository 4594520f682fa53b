"""The reference pages and JSON schemas, written from the code: each module here writes the page of its name."""
