"""What a picture of a moving robot costs its page, run by hand where chromium is installed:

    python tests/export/pictures_a_second.py ROBOT.sdf

The robot falls for a second, the player draws 100 of its pictures at 1280 × 800, and it is printed how long a picture takes, and for how
much of that the script waits for the picture of solids. Without a graphics processor the browser's own software draws that one, and this
wait is its work.
"""

import sys
import tempfile
from pathlib import Path

from browser import Browser

import ncgen
from ncgen.view.player import write_player

DRAWN = """new Promise((done) => {
  const own = CanvasRenderingContext2D.prototype.drawImage;
  let waited = 0, script = 0, count = 0;
  CanvasRenderingContext2D.prototype.drawImage = function (...given) {
    const start = performance.now();
    own.apply(this, given);
    waited += performance.now() - start;
  };
  const begin = performance.now();
  function one() {
    state.frame = count % (lastFrame + 1);
    const start = performance.now();
    draw();
    script += performance.now() - start;
    if (++count < 100) requestAnimationFrame(one);
    else done([(performance.now() - begin) / count, script / count, waited / count]);
  }
  requestAnimationFrame(one);
})"""


def main(file: str) -> None:
    run = ncgen.simulate(ncgen.compile(ncgen.load(file)), 1.0, points=121)
    with tempfile.TemporaryDirectory() as folder, Browser(Path(folder) / "profile") as browser:
        page = write_player(run, Path(folder) / "robot.html")
        browser.open(page)
        browser.value(DRAWN)  # once, until the browser has compiled it
        picture, script, waited = browser.value(DRAWN)
        print(f"{page.stat().st_size / 1e6:.2f} MB, {1000 / picture:.0f} pictures a second of {picture:.1f} ms each:")
        print(f"{script - waited:.1f} ms of script, {waited:.1f} ms waiting for the picture of solids; said: {browser.said or 'nothing'}")


if __name__ == "__main__":
    main(sys.argv[1])
