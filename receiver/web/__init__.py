"""Cuecast in web pages: the component `<cuecast-player>`, its build, and folders with a programme.

In: a marked programme, a voice, the module of `native`. Out: `dist`, a folder for static servers.
May import: `drawing`, `export`, `native`.
"""
