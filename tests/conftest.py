"""What every test of this project has."""

from __future__ import annotations

import gc
import signal
import sys
from pathlib import Path

import pytest
import sweeps
from hypothesis import settings
from hypothesis.internal.conjecture import providers
from passed_before import PassedBefore

_GREW = 100  # modules; about a third of what the first whole run of a process imports
_ALLOCATED = 50_000  # objects between two collections; at Python's 700, a fifteenth of all tests is collecting
_frozen_with = 0


def pytest_addoption(parser):
    """Let sweeps be run whole."""
    parser.addoption("--soak", action="store_true", help="run sweeps whole, and tests that are marked `soak`")
    parser.addoption("--passed-before", type=Path, metavar="FILE", help="leave these tests out, and add what passes")


def pytest_configure(config):
    """Tell how much of each sweep is run, before test modules are imported and their parameters made."""
    sweeps.begin(whole=config.getoption("soak"))
    _give_examples(soak=config.getoption("soak"))
    gc.set_threshold(_ALLOCATED)
    if config.getoption("passed_before"):
        config.pluginmanager.register(PassedBefore(config.getoption("passed_before"), config))


def _give_examples(*, soak):
    """Try properties with some examples, the same each time; in a soak with many, and others each time.

    No example has a deadline: one that waits for a busy core is not wrong.
    """
    settings.register_profile("sample", max_examples=sweeps.examples(100), derandomize=True, deadline=None)
    settings.register_profile("soak", max_examples=sweeps.examples(100), deadline=None)
    settings.load_profile("soak" if soak else "sample")
    if not soak and hasattr(providers, "_get_local_constants"):
        # It reads every module that happens to be loaded, for seconds, to try its constants: no two runs are the same.
        providers._get_local_constants = providers.Constants


def pytest_collection_modifyitems(config, items):
    """Leave out what belongs to a soak only."""
    if config.getoption("soak"):
        return
    soaking = [item for item in items if item.get_closest_marker("soak")]
    config.hook.pytest_deselected(items=soaking)
    items[:] = [item for item in items if not item.get_closest_marker("soak")]


@pytest.fixture(scope="session", autouse=True)
def _no_collection_after_each_run():
    """Let a run within a test end without pytest's own garbage collections; those of the outer session stay."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("_pytest.unraisableexception.gc_collect_harder", lambda *_: None, raising=False)
        yield


@pytest.fixture(scope="session", autouse=True)
def _no_index_outside(tmp_path_factory):
    """Keep the index of the runs that tests list out of the user's own folder."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("hil.evidence.index.cache_folder", lambda kind: tmp_path_factory.getbasetemp() / kind)
        yield


@pytest.fixture(scope="session", autouse=True)
def _heard_by_children():
    """Let what tests start hear requests to end, also under `nohup` and in the background of a script.

    An ignored signal stays ignored in every process that is started, a caught one does not.
    """
    ignored = [each for each in (signal.SIGINT, signal.SIGHUP) if signal.getsignal(each) is signal.SIG_IGN]
    for each in ignored:
        signal.signal(each, lambda *_: None)
    yield
    for each in ignored:
        signal.signal(each, signal.SIG_IGN)


def pytest_collection_finish():
    """Leave what was collected out of every later garbage collection: it stays until the end."""
    _freeze()


def pytest_runtest_setup():
    """Leave out as well what the tests have imported meanwhile."""
    if len(sys.modules) > _frozen_with + _GREW:
        _freeze()


def _freeze():
    global _frozen_with  # noqa: PLW0603 - of the process, as the collector is
    _frozen_with = len(sys.modules)
    gc.collect()
    gc.freeze()
