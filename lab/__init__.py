"""Programs that make the assets again: run from a checkout, in no wheel.

In: corpora, a mesh, lexica, recognisers of others. Out: files of ``synth/assets``,
``spec/data`` and ``receiver/assets``. May import: all packages; none imports it.

======================================  =======================================================
``python -m lab.lexicon``               ``synth/assets/lexicon.txt.xz``, from Lexique
``python -m lab.names``                 ``synth/assets/names.txt.xz``, from gruut
``python -m lab.body``                  ``synth/assets/hm08_markers.npz`` and ``reach_*.npz``
``python -m lab.durations``             ``synth/assets/durations.npz``, from labelled speech
``python -m lab.recogniser.train``      ``synth/assets/ear.npz`` and ``heard_phones.npz``
``python -m lab.key_times``             tables of `synth.planning.prosody.key_times`, printed
``python -m lab.voice``                 ``spec/data/voices/claire.npz``
``python -m lab.coding``                ``spec/data/coding``; ``--format``: ``tables.json``
``python -m lab.filmed``                motions for ``lab.coding --filmed``
``python -m lab.avatar``                ``receiver/assets/avatar_*.npz``
``python -m lab.corpora``               the paper's three corpora, performed by a virtual cuer
======================================  =======================================================
"""
