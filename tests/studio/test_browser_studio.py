"""The whole studio in a browser: a script is seen, a reload and a crash keep the work, pages keep apart."""

from __future__ import annotations

from studio_page import difference

from facegen.studio.work import FaceWork


def test_a_work_survives_a_reload_and_the_servers_end(studio, browser_page):
    first = studio()
    page = browser_page(first.server)
    page.until(lambda: len(first.pages) == 1)
    neutral = page.face()
    one, = first.pages.values()
    one.change("script", face=FaceWork(units={"27": 1.0, "L1": 1.0, "R1": 1.0}))
    assert one.stage.settle()
    opened = page.changed(neutral)
    assert difference(opened, neutral) > 0.01
    page.reload()
    page.until(lambda: len(first.pages) == 1 and one not in first.pages.values())
    page.until(lambda: difference(page.pixels(), opened) < 0.002)
    work = page.work
    page.close()                                        # what is open draws, and others wait
    other = browser_page(first.server)                  # another page is another work
    other.until(lambda: difference(other.pixels(), neutral) < 0.002)
    other.close()
    first.stop()                                        # and another server finds what this one left
    second = studio()
    again = browser_page(second.server, f"{second.server.url}w/{work}")
    again.until(lambda: difference(again.pixels(), opened) < 0.002)
