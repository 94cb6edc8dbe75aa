// Runs a declarative Jenkinsfile in a folder of a project: each stage in a workspace of its own, between which
// only stashed files move. Knows the sections and steps that docs/ci-recipes.md uses, with the parameters that
// https://www.jenkins.io/doc/book/pipeline/syntax/ and the pages of the plugins list; any other is an error.
//
//   groovy jenkins.groovy Jenkinsfile PROJECT WORK

import java.nio.file.FileSystems

class Run {
    File project, work
    Map<String, String> environment = [:]
    Map<String, File> stashes = [:]
    List<String> published = []
    boolean failed = false
    int workspaces = 0

    // The files of a workspace that match a pattern, by their paths in it.
    static List<String> matching(File folder, String pattern) {
        def matcher = FileSystems.default.getPathMatcher("glob:$pattern")
        def paths = []
        folder.eachFileRecurse { file ->
            def path = folder.toPath().relativize(file.toPath())
            if (file.file && matcher.matches(path)) paths << path.toString()
        }
        paths
    }

    static void copy(File from, File to, List<String> paths) {
        paths.each { path ->
            def file = new File(to, path)
            file.parentFile.mkdirs()
            file.bytes = new File(from, path).bytes
            file.executable = new File(from, path).canExecute()
        }
    }

    static void call(Closure body, Object delegate) {
        body.delegate = delegate
        body.resolveStrategy = Closure.DELEGATE_FIRST
        body()
    }

    static void check(Map given, List<String> known) {
        def unknown = given.keySet() - known
        if (unknown) throw new IllegalArgumentException("unknown parameters $unknown")
    }
}

// Statements of a section that needs an agent: what runs before the steps is only remembered.
class Pipeline {
    Run run
    boolean hasAgent = false
    final Object none = new Object()

    void agent(Object none) { hasAgent = true }
    void agent(Closure body) { hasAgent = true; Run.call(body, new Agent()) }
    void options(Closure body) { Run.call(body, new Options()) }
    void environment(Closure body) { Run.call(body, new Environment(run: run)) }
    void stages(Closure body) { Run.call(body, new Stages(run: run, cell: [:])) }
}

class Agent { void label(String name) { } }

class Options { void timeout(Map given) { Run.check(given, ['time', 'unit', 'activity']) } }

class Environment {
    Run run
    void setProperty(String name, Object value) {
        if (name == 'run') this.@run = value else run.environment[name] = value
    }
}

class Stages {
    Run run
    Map<String, String> cell
    void stage(String name, Closure body) {
        println "stage $name $cell"
        def stage = new Stage(run: run, cell: cell)
        Run.call(body, stage)
        stage.finish()
    }
}

class Stage {
    Run run
    Map<String, String> cell
    List<Closure> deferred = []
    Closure always
    void agent(Closure body) { Run.call(body, new Agent()) }
    void steps(Closure body) { deferred << body }
    void matrix(Closure body) { Run.call(body, new Matrix(run: run)) }
    void post(Closure body) { Run.call(body, new Post(stage: this)) }
    void finish() {
        if (!deferred) return
        def folder = new File(run.work, "workspace-${run.workspaces++}")
        folder.mkdirs()
        Run.copy(run.project, folder, Run.matching(run.project, '**'))
        def steps = new Steps(run: run, folder: folder, cell: cell)
        try {
            deferred.each { Run.call(it, steps) }
        } catch (Failure failure) {
            println failure.message
            run.failed = true
        }
        if (always) Run.call(always, steps)
    }
}

class Post {
    Stage stage
    void always(Closure body) { stage.always = body }
}

class Matrix {
    Run run
    Map<String, List<String>> all = [:]
    void agent(Closure body) { Run.call(body, new Agent()) }
    void axes(Closure body) { Run.call(body, new Axes(matrix: this)) }
    void stages(Closure body) {
        assert all.size() == 1
        all.each { name, values ->
            values.each { value ->
                body = (Closure) body.clone()
                Run.call(body, new Stages(run: run, cell: [(name): value]))
            }
        }
    }
}

class Axes {
    Matrix matrix
    void axis(Closure body) {
        def axis = new Axis()
        Run.call(body, axis)
        matrix.all[axis.name] = axis.values
    }
}

class Axis {
    String name
    List<String> values
    void name(String text) { name = text }
    void values(String... texts) { values = texts as List }
}

class Failure extends RuntimeException { Failure(String message) { super(message) } }

class Steps {
    Run run
    File folder
    Map<String, String> cell
    // `${SHARD}` in a text of Groovy.
    Object propertyMissing(String name) {
        def known = run.environment + cell
        if (!known.containsKey(name)) throw new MissingPropertyException(name, Steps)
        known[name]
    }
    void sh(String script) {
        def builder = new ProcessBuilder('sh', '-xe', '-c', script).directory(folder).inheritIO()
        builder.environment().putAll(run.environment + cell)
        def code = builder.start().waitFor()
        if (code != 0) throw new Failure("script returned exit code $code")
    }
    void stash(Map given) {
        Run.check(given, ['name', 'includes', 'excludes', 'allowEmpty', 'useDefaultExcludes'])
        def files = Run.matching(folder, given.includes)
        if (!files && !given.allowEmpty) throw new Failure("no files included in stash '$given.name'")
        def kept = new File(run.work, "stash-$given.name")
        Run.copy(folder, kept, files)
        run.stashes["$given.name".toString()] = kept
    }
    void unstash(String name) {
        def kept = run.stashes[name]
        if (kept == null) throw new Failure("No such saved stash '$name'")
        Run.copy(kept, folder, kept.exists() ? Run.matching(kept, '**') : [])
    }
    void catchError(Map given, Closure body) {
        Run.check(given, ['buildResult', 'stageResult', 'message', 'catchInterruptions'])
        assert [given.buildResult, given.stageResult] == ['SUCCESS', 'FAILURE']
        try { Run.call(body, this) } catch (Failure failure) { println failure.message }
    }
    void archiveArtifacts(Map given) {
        Run.check(given, ['artifacts', 'allowEmptyArchive', 'excludes', 'fingerprint', 'onlyIfSuccessful'])
        publish(given.artifacts, given.allowEmptyArchive)
    }
    void junit(String pattern) { publish(pattern, false) }
    void recordIssues(Map given) { Run.check(given, ['tool', 'tools', 'qualityGates']) }
    Object sarif(Map given) { Run.check(given, ['pattern', 'id', 'name']); publish(given.pattern, false) }
    void recordCoverage(Map given) {
        Run.check(given, ['tools', 'qualityGates', 'sourceDirectories'])
        given.tools.each {
            Run.check(it, ['parser', 'pattern'])
            assert it.parser in ['COBERTURA', 'JACOCO', 'PIT']
            publish(it.pattern, false)
        }
    }
    private Object publish(String pattern, boolean mayBeEmpty) {
        def files = Run.matching(folder, pattern)
        if (!files && !mayBeEmpty) throw new Failure("no files match '$pattern'")
        run.published.addAll(files)
        pattern
    }
}

def run = new Run(project: new File(args[1]), work: new File(args[2]))
def shell = new GroovyShell(new Binding([pipeline: { Closure body ->
    def pipeline = new Pipeline(run: run)
    Run.call(body, pipeline)
    assert pipeline.hasAgent : 'a pipeline has an agent'
}]))
shell.evaluate(new File(args[0]))
println "published: ${run.published.sort()}"
assert ['coverage.xml', 'junit.xml', 'results.sarif'].every { it in run.published }
System.exit(run.failed ? 1 : 0)
