from .compare.compare import (
    RunComparison as RunComparison,
)
from .compare.compare import (
    check_any as check_any,
)
from .compare.compare import (
    compare_run as compare_run,
)
from .compare.compare import (
    comparison_table as comparison_table,
)
from .compare.compare import (
    uniform_rod as uniform_rod,
)
from .compare.compare import (
    write_comparison as write_comparison,
)
from .compare.export import (
    check_export as check_export,
)
from .compare.export import (
    export_runs as export_runs,
)
from .compare.metrics import (
    circularity as circularity,
)
from .compare.metrics import (
    position_at as position_at,
)
from .demo import (
    run_demo as run_demo,
)
from .design.goals import (
    Goal as Goal,
)
from .design.goals import (
    radius_goal as radius_goal,
)
from .design.makeable import (
    Makeable as Makeable,
)
from .design.path import (
    read_path as read_path,
)
from .design.search import (
    Design as Design,
)
from .design.search import (
    Task as Task,
)
from .design.search import (
    find_designs as find_designs,
)
from .design.through import (
    Through as Through,
)
from .design.through import (
    design_through as design_through,
)
from .doctor import (
    as_dicts as as_dicts,
)
from .doctor import (
    examine as examine,
)
from .examples import (
    copy_examples as copy_examples,
)
from .expansion.data import (
    inputs_of as inputs_of,
)
from .figures.several import (
    gmc_numbers as gmc_numbers,
)
from .figures.write import (
    write_figures as write_figures,
)
from .fit.models import (
    model_sentence as model_sentence,
)
from .fit.nuisance import (
    NUISANCE_NAMES as NUISANCE_NAMES,
)
from .fit.nuisance import (
    Nuisance as Nuisance,
)
from .fit.posterior import (
    check_installed as check_installed,
)
from .fit.posterior import (
    sample_posterior as sample_posterior,
)
from .fit.problem import (
    common_support as common_support,
)
from .fit.proposals import (
    Proposal as Proposal,
)
from .fit.proposals import (
    limits_of_knowledge as limits_of_knowledge,
)
from .fit.proposals import (
    proposals as proposals,
)
from .fit.records import (
    Posterior as Posterior,
)
from .fit.records import (
    Suspect as Suspect,
)
from .fit.records import (
    Verdict as Verdict,
)
from .fit.refit import (
    with_refitted as with_refitted,
)
from .fit.result import (
    FitResult as FitResult,
)
from .fit.result import (
    write_fit as write_fit,
)
from .fit.runs import (
    fit_runs as fit_runs,
)
from .fit.runs import (
    try_fit as try_fit,
)
from .imports.door import (
    read_shape as read_shape,
)
from .imports.door import (
    read_shapes as read_shapes,
)
from .imports.finish import (
    report_imported as report_imported,
)
from .imports.judge import (
    Reading as Reading,
)
from .imports.run import (
    ImportedRun as ImportedRun,
)
from .imports.run import (
    import_table as import_table,
)
from .imports.steps import (
    write_template as write_template,
)
from .library.query import (
    write_table as write_table,
)
from .library.space import (
    read_space as read_space,
)
from .library.sql import (
    ask as ask,
)
from .lumen.in_lumen import (
    InLumen as InLumen,
)
from .lumen.run import (
    lumen_table as lumen_table,
)
from .lumen.run import (
    measure_in_lumen as measure_in_lumen,
)
from .package.crate import (
    Description as Description,
)
from .package.crate import (
    write_package as write_package,
)
from .paper.audit import (
    audit_paper as audit_paper,
)
from .paper.audit import (
    write_audit as write_audit,
)
from .paper.paper import (
    reproduce as reproduce,
)
from .paper.probe import (
    fit_standoff as fit_standoff,
)
from .paper.probe import (
    from_probe_reading as from_probe_reading,
)
from .paper.probe import (
    read_probe_csv as read_probe_csv,
)
from .paper.probe import (
    remanence_from_probe_mT as remanence_from_probe_mT,
)
from .recipe.law import (
    Law as Law,
)
from .recipe.law import (
    Prediction as Prediction,
)
from .recipe.law import (
    fit_law as fit_law,
)
from .recipe.law import (
    predict_mixture as predict_mixture,
)
from .recipe.law import (
    read_law as read_law,
)
from .recipe.law import (
    write_law as write_law,
)
from .recipe.material import (
    Mixture as Mixture,
)
from .recipe.material import (
    mixtures as mixtures,
)
from .recipe.material import (
    read_ratio as read_ratio,
)
from .recipe.rods import (
    fit_rods as fit_rods,
)
from .report.build import (
    write_report as write_report,
)
from .ring import (
    AGREE as AGREE,
)
from .ring import (
    Factor as Factor,
)
from .ring import (
    apart as apart,
)
from .ring import (
    fit_factor as fit_factor,
)
from .ring import (
    ring_factor as ring_factor,
)
from .runs.data import (
    RunData as RunData,
)
from .runs.field_scan import (
    judge_scan as judge_scan,
)
from .runs.load import (
    load_run as load_run,
)
from .runs.load import (
    load_runs as load_runs,
)
from .runs.witness import (
    FieldWitness as FieldWitness,
)
from .runs.witness import (
    witness_of as witness_of,
)
from .schemas import (
    toml_schema as toml_schema,
)
from .schemas import (
    write_toml_schemas as write_toml_schemas,
)
from .twin.bench import (
    TwinBench as TwinBench,
)
from .twin.plan_preview import (
    preview_plan as preview_plan,
)
from .twin.run import (
    bench_run as bench_run,
)
from .twin.run import (
    keep_stills as keep_stills,
)
from .twin.run import (
    open_twin_bench as open_twin_bench,
)
from .warm_up import (
    is_warm as is_warm,
)
from .warm_up import (
    stored as stored,
)
from .warm_up import (
    warm_up_beside as warm_up_beside,
)
