"""The report of a plan as one page: HTML, Markdown or PDF.

`content` says what is on it, in the pieces of `document`; `html` and `markdown` give them a form, `pdf` prints.
"""
