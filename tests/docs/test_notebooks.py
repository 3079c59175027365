"""A tutorial becomes a notebook with what its programs print and draw, and a page with its pictures."""

import json

import pytest

from docs.tools import notebooks

PAGE = """# A page

Words.

```python
from matplotlib.figure import Figure

figure = Figure(figsize=(1, 1))
print("one", 2)
```

```text
this is left out
```

<!-- picture: nothing but a frame -->

More words.

```python
print(figure.get_figwidth())
```
"""


@pytest.fixture(scope="module")
def done():
    return notebooks.run(PAGE)


def test_a_picture_is_drawn_where_the_page_requests_one(done):
    assert [bool(cell.pictures) for cell in done] == [False, True, False, False]
    assert done[1].pictures["png"].startswith(b"\x89PNG")
    page = notebooks.with_pictures(PAGE, "name")
    assert "![nothing but a frame](tutorials/name-1.svg)" in page and "picture:" not in page
    assert set(notebooks.files(done, "name")) == {"tutorials/name-1.svg", "tutorials/name.ipynb"}


def test_the_notebook_is_one(done):
    made = json.loads(notebooks.files(done, "name")["tutorials/name.ipynb"])
    assert made == json.loads(json.dumps(notebooks.notebook(done)))
    code = [cell for cell in made["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == [1, 2]
    assert code[0]["outputs"][0]["text"] == ["one 2\n"]
    assert set(code[0]["outputs"][1]["data"]) == {"image/png", "text/plain"}
    nbformat = pytest.importorskip("nbformat", reason="notebooks are checked with the docs extra")
    nbformat.validate(made)
