"""``python -m tests.bits.record``: write the table of hashes, after an intended change of bits."""

import json
import sys
from pathlib import Path

from tests.bits.runs import RUNS, made_with

TABLE = Path(__file__).with_name("hashes.json")

if __name__ == "__main__":
    hashes = {name: run.hash() for name, run in RUNS.items()}
    before = json.loads(TABLE.read_text("utf-8"))["hashes"] if TABLE.exists() else {}
    changed = [name for name in hashes if before.get(name) != hashes[name]]
    content = {"made with": made_with(), "hashes": hashes}
    TABLE.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8", newline="\n")
    sys.stdout.write(f"{len(hashes)} runs, {len(changed)} changed: {', '.join(changed)}\n")
