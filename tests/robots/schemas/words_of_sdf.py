"""Prints every element and attribute of SDF 1.4 to 1.12 from the published descriptions, gazebosim/sdformat's folder `sdf`:

    python tests/robots/schemas/words_of_sdf.py FOLDER/sdf > tests/robots/schemas/sdf.txt

A line is `path | first-last version | type, or = file that describes it | defaults of all versions`, paths beginning with the file's name.
"""

import sys
import xml.etree.ElementTree as ET
from pathlib import Path

VERSIONS = [f"1.{k}" for k in range(4, 13)]
UNSAID = (None, "", "__default__", "__default_topic__")


def described(folder: Path, path: str, element: ET.Element):
    """(path, type, default) of all that stands in an element's description."""
    for each in element:
        if each.tag == "attribute":
            yield f"{path}@{each.get('name')}", each.get("type"), each.get("default")
        elif each.tag == "include":
            file = each.get("filename")
            yield f"{path}/{ET.parse(folder / file).getroot().get('name')}", f"= {file.removesuffix('.sdf')}", None
        elif each.tag == "element" and each.get("ref"):
            yield f"{path}/{each.get('ref')}", f"= {each.get('ref')}", None
        elif each.tag == "element" and not each.get("copy_data"):
            inside = f"{path}/{each.get('name')}"
            yield inside, each.get("type") or "group", each.get("default")
            yield from described(folder, inside, each)


def words(root: Path):
    """{path: (versions, types, defaults)}"""
    found = {}
    for version in VERSIONS:
        for file in sorted((root / version).glob("*.sdf")):
            for path, kind, default in described(root / version, file.stem, ET.parse(file).getroot()):
                versions, kinds, defaults = found.setdefault(path, ([], [], []))
                versions.append(version)
                kinds += [kind] if kind not in kinds else []
                defaults += [default] if default not in (*UNSAID, *defaults) else []
    return found


if __name__ == "__main__":
    for path, (versions, kinds, defaults) in sorted(words(Path(sys.argv[1])).items()):
        print(f"{path} | {versions[0]}-{versions[-1]} | {kinds[-1]} | {' or '.join(defaults)}".rstrip())
