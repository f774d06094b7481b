"""The report of a plan as one page: `content` says what is on it, in the pieces of `document`; `html` writes it."""
