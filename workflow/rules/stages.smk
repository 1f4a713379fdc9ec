# Every rule is a stage of the same name: what it takes, says and asks for follows from its record.
for stage in (*CASE_STAGES, *VIEW_STAGES, *COHORT_STAGES, *PLAIN_STUDIES):

    rule:
        name:
            stage
        input:
            unpack(inputs_of(stage)),
        output:
            named(stage),
            *beside(stage),
        log:
            log_of(stage),
        benchmark:
            benchmark_of(stage)
        resources:
            mem_mb=memory_of(stage),
            runtime=minutes_of(stage),
        params:
            settings=settings_of(stage),
            code=stage_digest(stage),
            subject=subject_of,
            sources=sources_of(stage),
        message:
            message_of(stage)
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
