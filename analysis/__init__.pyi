from .compare.compare import (
    compare_run as compare_run,
)
from .compare.compare import (
    comparison_table as comparison_table,
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
    Posterior as Posterior,
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
from .fit.suspects import (
    Suspect as Suspect,
)
from .fit.verdict import (
    Verdict as Verdict,
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
    import_table as import_table,
)
from .imports.steps import (
    write_template as write_template,
)
from .package.crate import (
    Description as Description,
)
from .package.crate import (
    write_package as write_package,
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
from .runs.load import (
    load_run as load_run,
)
