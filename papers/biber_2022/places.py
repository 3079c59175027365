"""Places of the paper as a reader finds them: LaTeX labels become numbers of equations and figures.

The numbers are those that the source on arXiv (2208.11685) gets when it is compiled: equations are
numbered through, three starred cases and one starred display have no number.
"""

from __future__ import annotations

import re

#: Equation numbers by label, in order of appearance.
EQUATIONS = {
    "v_divs_gen": 7,
    "v_div_slip": 8,
    "v_div_roll": 9,
    "kv": 11,
    "kv_rescaled": 15,
    "nforce": 16,
    "vec_p": 18,
    "sliding": 20,
    "alpha": 21,
    "switching_con": 24,
    "lie2_kv": 25,
    "switching_con2": 26,
    "2conds": 27,
    "generic_eq": 28,
    "lift_off_cond": 29,
    "functions_constraints": 30,
    "force_constraints": 31,
    "functions_constraints_horizontal": 32,
    "functions_constraints_horizontal_scaling": 34,
    "derivatives_constraint": 36,
    "generic_rescaled": 37,
    "functions_constraints_new_scaling": 38,
    "force_constraints_new_scaling": 39,
    "sigma_def": 45,
    "nus": 46,
    "normal_sliding": 47,
    "normal_red": 48,
    "normal_red_visible": 50,
    "second_derivativeF1": 51,
    "second_derivativeF2": 52,
    "nus_calc": 54,
}

#: Figure numbers by label.
FIGURES = {
    "vid_still": "1",
    "setting_notation": "2",
    "ics": "3",
    "tangential_vel_experiments": "4",
    "data_vel_change": "5",
    "trajectories": "6",
    "settings_kv": "7",
    "filippov_convexity": "8",
    "geometries": "9",
    "kv_pert": "10",
    "setting_generic": "11",
    "2-fold": "12",
    "visible-fp1": "13 (a)",
    "visible-fp2": "13 (b)",
}

_LABELS = "|".join(sorted(map(re.escape, EQUATIONS), key=len, reverse=True))
_PICTURES = "|".join(sorted(map(re.escape, FIGURES), key=len, reverse=True))
_EQUATION = re.compile(rf"(?:[Ee]quation )?\((?P<label>{_LABELS})(?:, F2)?\)")
_FIGURE = re.compile(rf"(?:[Ff]igure |^)(?P<label>{_PICTURES})(?![\w-])")


def readable(text: str) -> str:
    """Replace the labels in a text.

    Examples
    --------
    >>> readable("Sec. 4, after (nus_calc)")
    'Sec. 4, after eq. (54)'
    >>> readable("Sec. 3.2, figure kv_pert; table ics")
    'Sec. 3.2, Fig. 10; Table 1'
    """
    text = _EQUATION.sub(lambda found: f"eq. ({EQUATIONS[found['label']]})", text)
    text = _FIGURE.sub(lambda found: f"Fig. {FIGURES[found['label']]}", text)
    return re.sub(r"\b[Tt]able ics\b", "Table 1", text)


def equation(label: str) -> str:
    """What an entry of the list of displayed equations is called: its number, or what it says."""
    return f"eq. ({EQUATIONS[label]})" if label in EQUATIONS else label
