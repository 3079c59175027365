"""Laws of a mode: multipliers that keep the motion on a surface, and the smooth field that they give.

- All modes, with multipliers as inputs: ``coupled``; their guards: ``switches``.
- An element whose multiplier enters a later derivative: ``coupled`` too; a root in the field: ``roots``.
- Admissible modes without a run (``classify``): ``complementarity``, ``layer``; for sets of
  codimension two and more ``frozen``. In a run the driver decides (``flow/engine``).
- A mode as a system of its own: ``motion``, ``followed``.

Classes of two-folds are in ``nonsmooth/local/two_folds``.
"""
