# make demo    set up .venv and run the whole loop on the twin bench
# make test    set up .venv with the test tools and run the test-suite
# make check   lint, format and type checks, and the import contract
# make docs    build the site into docs/site (the tests of this are in .ci/run)
# make mutants  break a few places at random and see whether the tests notice (COUNT=12 SEED=...)
# make release VERSION=0.2.0   changelog, hashed pins, wheel and sdist, checked and tried
# make clean   remove .venv and build products

PYTHON ?= python3
VENV   ?= .venv
OUT    ?= demo
BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip install --quiet --disable-pip-version-check

# Imports keep what they compile, else each of the many processes would compile it anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test check docs mutants release clean
.DEFAULT_GOAL := demo

demo: $(VENV)/.ready
	$(BIN)/magbend demo --out $(OUT)

test: $(VENV)/.ready-test
	$(BIN)/python -m pytest -n 4 --dist loadfile --no-loadscope-reorder -q

check: $(VENV)/.ready-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	rm -rf build/check build/lib
	$(PIP) --no-deps --target build/check .
	cd build/check && ../../$(BIN)/mypy --config-file ../../pyproject.toml \
	  -p magbend --namespace-packages --explicit-package-bases
	cd build/check && ../../$(BIN)/lint-imports --config ../../pyproject.toml

docs: $(VENV)/.ready-test
	$(BIN)/python -m sphinx -W --keep-going -q -j 2 docs docs/site
	@echo "docs/site/index.html"

mutants: $(VENV)/.ready-test
	$(BIN)/python tests/mutants.py --count $(or $(COUNT),12) $(if $(SEED),--seed $(SEED))

release: $(VENV)/.ready-test
	$(PIP) --constraint constraints.txt build twine pip-tools
	$(BIN)/python .ci/release.py $(VERSION)

$(VENV)/.created:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "magbend needs Python 3.11 or newer; found $$($(PYTHON) --version). Name another one: make PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	touch $@

# pip would compile every module of every package, one after the other; the imports
# compile the few that are used.
$(VENV)/.ready: $(VENV)/.created pyproject.toml constraints.txt
	@echo "installing magbend and its pinned dependencies into $(VENV) (once, about a minute)"
	$(PIP) --no-compile --constraint constraints.txt --editable .
	touch $@

$(VENV)/.ready-test: $(VENV)/.created pyproject.toml constraints.txt
	@echo "installing magbend, all extras and the test tools into $(VENV) (once, a few minutes)"
	$(PIP) --constraint constraints.txt --editable '.[all,test]'
	$(BIN)/python -m magbend.analysis.warm_up
	touch $@ $(VENV)/.ready

clean:
	rm -rf $(VENV) build dist docs/made docs/site
