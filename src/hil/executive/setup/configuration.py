"""Configuration: everything that a run is made of, read and checked before anything is opened."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TypeVar

from hil.bench.binding import check_twin, simulated_twin
from hil.bench.file.reading import load_bench
from hil.bench.live import Reach, reach_of_hardware, reach_of_served
from hil.documents.findings import Findings
from hil.documents.suggest import did_you_mean
from hil.executive.setup.ground import Ground
from hil.executive.setup.hand_instruments import HandInstrument, hand_instruments
from hil.executive.setup.inputs import Inputs
from hil.executive.setup.software import customised, require_assertions
from hil.executive.setup.workspace import Workspace, find_workspace
from hil.model.bench import BenchSpec
from hil.model.errors import ConfigurationError, Finding, Refused
from hil.model.identity import Dut, Purpose, Source
from hil.registers.units import find_dut, load_duts
from hil.requirements.catalogue import Catalogue, load_catalogue
from hil.requirements.parameters import Parameters, load_parameters

__all__ = ["Configuration", "Request", "configure", "fitting_plans", "reach_of", "require_fitting"]

_BENCH_FILE = "bench.yaml"
_OF_THE_PACKAGE = frozenset({"calibration.json", "duts.yaml"})
_ELSEWHERE = "use --source simulated here"
_NOT_SIMULATED = "is --source simulated missing? On hardware, name the article that is on the bench"
_Loaded = TypeVar("_Loaded")


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A person's request to the executive.

    Attributes:
        start: the folder from which the workspace is searched for.
        plans: plans, as paths or names.
        bench: the bench's name.
        dut: serial number of the device under test.
        source: hardware or simulated.
        purpose: why the run is made.
        operator: the person's name, empty if not given.
        skips: reasons why cases are not run, by part of their id.
        only: parts of the ids of the only cases to run; all if there is none.
        overrides: parameters changed on the command line.
        answers: a file with answers to questions.
        person: whether a person at the terminal answers, even on a simulated bench.
        output: where the package goes, the workspace's reports if None.
        served: the folder in which another process serves the simulated bench, None if none does.
        epoch: UTC of bench time zero, ISO 8601, for a bench outside this process.
        junit: where the results are also written as JUnit XML, None for nowhere else.
        strict: whether a requirement of the plans that the run leaves uncovered makes it fail.
        unattended: whether the run is unattended; that requires more of a bench outside this process.
        on_call: who is on call then.
        acknowledge_within_s: timeout for that person to answer when the bench is armed [s].
    """

    start: Path
    plans: tuple[str, ...]
    bench: str
    dut: str
    source: Source = Source.HARDWARE
    purpose: Purpose = Purpose.DEVELOPMENT
    operator: str = ""
    skips: Mapping[str, str] = field(default_factory=dict)
    only: tuple[str, ...] = ()
    overrides: Mapping[str, str] = field(default_factory=dict)
    answers: Path | None = None
    person: bool = False
    output: Path | None = None
    served: Path | None = None
    epoch: str = ""
    junit: Path | None = None
    strict: bool = False
    unattended: bool = False
    on_call: str = ""
    acknowledge_within_s: float = 600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Configuration:
    """A request with everything it names, read and found consistent."""

    request: Request
    workspace: Workspace
    plans: tuple[Path, ...]
    catalogue: Catalogue
    parameters: Mapping[str, Parameters]
    bench: BenchSpec
    dut: Dut
    inputs: Inputs
    hand: Mapping[str, HandInstrument] = field(default_factory=dict)

    @property
    def ground(self) -> Ground:
        """Where the run's inputs can be."""
        workspace, request = self.workspace, self.request
        apart = (path.resolve() for path in (workspace.reports, request.output, request.served) if path is not None)
        return Ground(workspace.root, [path for path in apart if not workspace.testplans.is_relative_to(path)])

    @property
    def reports(self) -> Path:
        """Where the package goes."""
        return self.request.output or self.workspace.reports

    @property
    def outside(self) -> bool:
        """Whether the bench is outside this process: hardware, or served by another one."""
        return self.request.source is Source.HARDWARE or self.request.served is not None

    def reach(self) -> Reach | None:
        """Return how the bench is reached, None if it is in this process; a served one is asked. See `reach_of`."""
        return reach_of(self.bench, self.request.source, self.request.served)

    @property
    def epoch(self) -> str:
        """UTC of bench time zero, ISO 8601; empty if it is not known."""
        return self.request.epoch or (self.bench.simulated.epoch if self.bench.simulated else "")

    def stands(self, plan: str, number: float) -> bool:
        """Return whether a number that a case computed with is one of its plan's parameters, or appears in a source.

        The number 1 does, because it scales nothing.
        """
        given = {abs(each) for row in self.parameters[plan].rows() for each in row.numbers}
        return abs(number) in {1.0, *given} or self.inputs.stands(number)

    @property
    def deviations(self) -> tuple[str, ...]:
        """What differs from the plans, a sentence each."""
        skipped = [f"case {case} is skipped: {reason}" for case, reason in sorted(self.request.skips.items())]
        only = [f"only these cases are run: {', '.join(self.request.only)}"] if self.request.only else []
        changed = (text for each in self.parameters.values() for text in each.deviations)
        return (*changed, *skipped, *only, *self.inputs.reaches, *customised())


def configure(request: Request) -> Configuration:
    """Read everything that the request names.

    Raises:
        Refused: for an unknown name, an article that a plan is not for, and a Python without assertions.
        ConfigurationError: with everything that is wrong in all files.
    """
    require_assertions()
    noted = Findings()
    workspace = find_workspace(request.start, noted, [(request.start / plan).resolve() for plan in request.plans])
    _require_reports(workspace, request)
    plans = _plans(workspace, request, noted)
    inputs = Inputs(workspace, plans, request.bench)
    findings = [*noted, *_taken_names(inputs, request)]
    with inputs.snapshot.reading():  # what is frozen is what is used
        catalogue = _gather(lambda: load_catalogue(workspace.root, plans), findings)
        parameters = {plan.name: _gather(partial(load_parameters, workspace.root, plan), findings) for plan in plans}
        bench = _gather(lambda: _bench(workspace, request), findings)
        duts = _gather(lambda: _duts(workspace), findings)
        hand = _gather(lambda: hand_instruments(inputs, workspace.fixtures, bench), findings) if bench else None
    if findings or catalogue is None or bench is None or duts is None or hand is None:
        raise ConfigurationError(tuple(findings))
    register = workspace.shown(workspace.duts)
    dut = find_dut(duts, request.dut, register)
    require_fitting(catalogue, dut, duts, request.source, register)
    return Configuration(
        request=request,
        workspace=workspace,
        plans=plans,
        catalogue=catalogue,
        parameters=_overridden({name: item for name, item in parameters.items() if item is not None}, request),
        bench=bench,
        dut=_dut(dut, request),
        inputs=inputs,
        hand=hand,
    )


def fitting_plans(request: Request) -> tuple[str, ...]:
    """Return the request's plans for its article; all of them if none is for it, or that cannot be determined.

    Naming a folder of plans means those that can be run; `configure` reports what is wrong with any of them.
    """
    try:
        workspace = find_workspace(request.start)
        plans = {asked: workspace.plan(asked, request.start) for asked in request.plans}
        catalogue = load_catalogue(workspace.root, tuple(plans.values()))
        part = find_dut(_duts(workspace), request.dut, "").part
    except (ConfigurationError, Refused):
        return request.plans
    named = {asked: catalogue.part_numbers(folder.name) for asked, folder in plans.items()}
    return tuple(asked for asked, parts in named.items() if not parts or part in parts) or request.plans


def _require_reports(workspace: Workspace, request: Request) -> None:
    """Require that evidence that counts, above all a FAIL, is kept where an audit finds it."""
    elsewhere = request.output is not None and request.output.resolve() != workspace.reports.resolve()
    if elsewhere and request.source is Source.HARDWARE and request.purpose.closes:
        raise Refused(
            f"--output: a run on hardware for {request.purpose.value} goes to {workspace.shown(workspace.reports)}, "
            "whose ledger must know it",
            "leave out --output, or use --purpose development or commissioning",
        )


def _taken_names(inputs: Inputs, request: Request) -> Iterator[Finding]:
    """Yield a finding for every file beside the bench file that would be overwritten in the package."""
    for path in inputs.bench_files:
        taken = path.name in _OF_THE_PACKAGE and (path.parent / _BENCH_FILE).is_file()
        if taken and request.source is not Source.REPLAYED:  # whose bench is that of a package
            text = "the package keeps a file of its own by this name: rename it, or move it out of the bench's folder"
            yield Finding(inputs.shown(path), 0, 0, text)


def _plans(workspace: Workspace, request: Request, noted: Findings) -> tuple[Path, ...]:
    try:
        return tuple(dict.fromkeys(workspace.plan(plan, request.start) for plan in request.plans))
    except Refused:
        noted.raise_if_any()  # wrong settings may be why there is no such plan
        raise


def reach_of(bench: BenchSpec, source: Source, served: Path | None) -> Reach | None:
    """Return how a bench outside this process is reached, None for one in it.

    Raises:
        Refused: for hardware on a system that cannot guard it, and for a folder in which no such bench is served.
    """
    if source is Source.HARDWARE and served is not None:
        raise Refused("a served bench is not hardware", "use --source simulated with --served")
    if served is not None:
        return reach_of_served(bench, served)
    if source is not Source.HARDWARE:
        return None
    if sys.platform != "linux":
        raise Refused("hardware is driven on Linux only: the guardian needs it", _ELSEWHERE)
    return reach_of_hardware(bench)


def _bench(workspace: Workspace, request: Request) -> BenchSpec:
    driven = request.source is not Source.REPLAYED
    if request.source is not Source.SIMULATED:
        return load_bench(workspace.benches, request.bench, workspace.root, driven=driven)
    bench = load_bench(workspace.benches, request.bench, workspace.root, twin=check_twin)
    simulated_twin(bench)
    return bench


def _dut(dut: Dut, request: Request) -> Dut:
    """Return the article, or refuse what is impossible with one that exists on simulated benches only."""
    if dut.simulated and request.source is Source.HARDWARE:
        raise Refused(f"{dut.serial} exists on simulated benches only, and this run is on hardware", _NOT_SIMULATED)
    if dut.simulated and request.source is Source.SIMULATED and request.purpose.closes:
        raise Refused(
            f"{dut.serial} exists on simulated benches only, so there is no {request.purpose.value} of it",
            "use --purpose development or commissioning, or name a real article",
        )
    return dut


def _duts(workspace: Workspace) -> tuple[Dut, ...]:
    findings = Findings()
    duts = load_duts(workspace.duts, workspace.shown(workspace.duts), findings)
    findings.raise_if_any()
    return duts


def _gather(load: Callable[[], _Loaded], findings: list[Finding]) -> _Loaded | None:
    try:
        return load()
    except ConfigurationError as error:
        findings.extend(error.findings)
        return None
    except Refused:
        if findings:  # a name may be unknown only because of them
            return None
        raise


def _overridden(parameters: dict[str, Parameters], request: Request) -> dict[str, Parameters]:
    """Override parameters as the command line says; each must exist in at least one of the plans."""
    for name, text in request.overrides.items():
        holders = [plan for plan, each in parameters.items() if name in {row.name for row in each.rows()}]
        for plan in holders or list(parameters)[:1]:
            parameters[plan] = parameters[plan].override(name, text)
    return parameters


def require_fitting(catalogue: Catalogue, dut: Dut, duts: Sequence[Dut], source: Source, register: str) -> None:
    """Require that every requested plan is for the article's part number, if it names any.

    Args:
        catalogue: the catalogue of the requested plans.
        dut: the requested article.
        duts: the whole register, from which others are suggested.
        source: of the bench; on hardware, no article is suggested that exists on simulated benches only.
        register: the register's path as shown to people.

    Raises:
        Refused: with the articles that fit.
    """
    named = {plan: parts for plan in catalogue.plans if (parts := catalogue.part_numbers(plan))}
    others = {plan: parts for plan, parts in named.items() if dut.part not in parts}
    if not others:
        return
    mismatches = "; ".join(f"{plan} is for {' or '.join(parts)}" for plan, parts in others.items())
    fitting = [
        each.serial
        for each in duts
        if all(each.part in parts for parts in named.values())
        if not (each.simulated and source is Source.HARDWARE)
    ]
    known = {part for parts in others.values() for part in parts}
    raise Refused(
        f"{dut.serial} has the part number {dut.part}, but {mismatches}{did_you_mean(dut.part, known)}",
        f"name one that fits with --dut: {', '.join(fitting)}" if fitting else _none(register, named),
    )


def _none(register: str, named: dict[str, tuple[str, ...]]) -> str:
    if len(named) > 1 and not set.intersection(*map(set, named.values())):
        return "no article fits all of these plans; run each by itself"
    return f"no article in {register} fits; register it there"
