"""The verbs of the command line, one module each (see `cuecast.command.cli`).

In: parsed options. Out: files, lines on standard output, an exit code. May import: `command`,
`conformance`, `demo`, `dubbing`, `evaluate`, `live`, `media`, `practice`.
"""
