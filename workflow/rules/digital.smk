# The embedded cohort: one rule a patient, whose outputs are the files that config/digital's tables name.
def made_output(path):
    """A file, or the folder of a DICOM series."""
    return str(path) if path.suffix else directory(str(path))


for case, files in MADE.items():

    rule:
        name:
            f"digital_{case}"
        output:
            str(DIGITAL / case / "digital.h5"),
            *map(made_output, files),
        log:
            str(DIGITAL / "logs" / f"{case}.log"),
        benchmark:
            str(DIGITAL / "benchmarks" / f"{case}.tsv")
        resources:
            mem_mb=lambda wildcards, attempt: 1500 * attempt,
            runtime=20,
        params:
            stage="digital",
            settings=settings_of("digital"),
            code=stage_digest("digital"),
            subject={"case": case, "laterality": case_row(case).laterality},
        message:
            f"{case}: digital patient"
        script:
            "../scripts/stage.py"
