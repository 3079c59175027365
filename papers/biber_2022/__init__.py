"""Biber, Champneys & Szalai 2022: the bounce of a hard spinning ball, reproduced and corrected.

``model`` states the equations in the paper's notation, ``printed`` what the paper prints where it
is wrong, ``results`` computes the claims, ``figures`` draws; ``python -m papers.biber_2022`` runs
everything.
"""
