"""Write the reference pages of this folder and the JSON schemas of ``scenes/schemas``: python -m docs.reference"""

from docs.reference.pages import ROOT, written

for path, text in written().items():
    (ROOT / path).parent.mkdir(exist_ok=True)
    (ROOT / path).write_text(text)
    print(path)
