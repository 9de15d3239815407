"""Reports: self-contained HTML, made from files alone.

`write_report(inputs, out)` in `skillframe.reports.page` is the one entry; `sources` reads; the section modules
(`headline`, `learned`, `runs`, `trust`, `provenance`) write; everything below them (`markup`, `svg`, `plots`,
`shapes`, `raster`, `replay`) draws.
"""
