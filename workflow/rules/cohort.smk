# What is made once for all cases.


# Material constants, and plate forces on a cube of tissue.
rule calibrate:
    input:
        unpack(inputs_of("calibrate")),
    output:
        named("calibrate"),
    log:
        log_of("calibrate"),
    benchmark:
        benchmark_of("calibrate")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            700, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=5,
    params:
        settings=settings_of("calibrate"),
        code=stage_digest("calibrate"),
        subject=subject_of,
    message:
        "cohort: calibrate"
    script:
        "../scripts/stage.py"


# Tables of the cohort.
rule tables:
    input:
        unpack(inputs_of("tables")),
    output:
        named("tables"),
        *table_files(),
    log:
        log_of("tables"),
    benchmark:
        benchmark_of("tables")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            1000, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=10,
    params:
        settings=settings_of("tables"),
        code=stage_digest("tables"),
        subject=subject_of,
    message:
        "cohort: tables"
    script:
        "../scripts/stage.py"


# The report, which opens in any browser.
rule report:
    input:
        unpack(inputs_of("report")),
    output:
        named("report"),
        str(RESULTS / "report.html"),
    log:
        log_of("report"),
    benchmark:
        benchmark_of("report")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            1000, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=10,
    params:
        settings=settings_of("report"),
        code=stage_digest("report"),
        subject=subject_of,
    message:
        "cohort: report"
    script:
        "../scripts/stage.py"


# Written only if no case failed.
rule complete:
    input:
        cases=[
            path for stage in CASE_STAGES + VIEW_STAGES for path in artefacts_of(stage)
        ],
        cohort=[artefacts_of(stage) for stage in COHORT_STAGES],
    output:
        complete_file(),
    log:
        str(RESULTS / "logs" / "complete.log"),
    benchmark:
        str(RESULTS / "benchmarks" / "complete.tsv")
    resources:
        mem_mb=500,
        runtime=5,
    message:
        "cohort: complete?"
    script:
        "../scripts/complete.py"
