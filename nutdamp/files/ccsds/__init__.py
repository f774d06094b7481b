"""Data messages of CCSDS 504.0-B-2: content once, as in `message`; `kvn` reads and writes it, `xml` only writes."""
