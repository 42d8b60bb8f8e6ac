from .compare.compare import (
    compare_run as compare_run,
)
from .compare.compare import (
    comparison_table as comparison_table,
)
from .fit.search import (
    fit_runs as fit_runs,
)
from .report.build import (
    write_report as write_report,
)
from .runs.load import (
    load_run as load_run,
)
