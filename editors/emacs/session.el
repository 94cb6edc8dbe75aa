;;; session.el --- A session of Emacs' dap-mode with `anyhit dap' -*- lexical-binding: t -*-

;; Emacs itself debugs a pixel: dap-mode starts the adapter, sets a breakpoint, goes where it
;; stops, steps, evaluates and lets the ray end. Adapter, template and file types are those of the
;; snippets in docs/debugging.md. `.ci/judge-editors' runs it.
;;
;; The scene's facts are those of tests/debugger/dap/vscode-swept-spheres.jsonl: the ray meets two swept
;; spheres, the any-hit shader ignores the first, and the closest hit is on the one from (-1, 0, 4)
;; to (2, 0, 4), whose axis is (3, 0, 0).

;;; Code:

(require 'dap-mode)
(require 'dap-ui)

(defconst session-root (expand-file-name "../../" (file-name-directory load-file-name)))
(defconst session-scene (expand-file-name "shaders/pass/debugger/swept-spheres/" session-root))

(setq dap-breakpoints-file (make-temp-file "anyhit-breakpoints")
      dap-auto-configure-features nil
      dap-output-buffer-filter nil
      default-directory session-root)

;; The snippet starts a program of this name.
(let ((program (getenv "ANYHIT")))
  (when program
    (add-to-list 'exec-path (file-name-directory (expand-file-name program)))))

(with-temp-buffer
  (insert-file-contents (expand-file-name "docs/debugging.md" session-root))
  (let ((snippets 0))
    (while (search-forward "```elisp\n" nil t)
      (let ((begin (point)))
        (search-forward "\n```\n")
        (eval-region begin (match-beginning 0))
        (setq snippets (1+ snippets))))
    (unless (= snippets 2)
      (error "The page has %d snippets, not 2" snippets))))

;; Each stage is a file of glsl-mode.
(dolist (stage '("rgen" "rint" "rahit" "rchit" "rmiss" "rcall" "comp"))
  (unless (eq 'glsl-mode (assoc-default (concat "main." stage) auto-mode-alist #'string-match))
    (error "main.%s is no file of glsl-mode" stage)))

(defun session-wait (what condition)
  "Wait until CONDITION holds, or fail with WHAT."
  (with-timeout (60 (error "It did not come to this: %s" what))
    (while (not (funcall condition))
      (accept-process-output nil 0.05)))
  (message "%s" what))

(defun session-frame ()
  "The stack frame at which the session has stopped."
  (let ((session (dap--cur-session)))
    (and session (dap--debug-session-active-frame session))))

(defun session-stopped-at (file line)
  "Wait until Emacs shows LINE of FILE."
  (session-wait
   (format "stopped at %s:%d" file line)
   (lambda ()
     (let ((frame (session-frame)))
       (and frame
            (= line (gethash "line" frame))
            (string= file (file-name-nondirectory (gethash "path" (gethash "source" frame)))))))))

(defun session-value (expression)
  "The value of EXPRESSION where the session has stopped."
  (let ((answer nil))
    (dap--send-message
     (dap--make-request "evaluate" (list :expression expression
                                         :frameId (gethash "id" (session-frame))
                                         :context "watch"))
     (lambda (response) (setq answer response))
     (dap--cur-session))
    (session-wait expression (lambda () answer))
    (if (gethash "success" answer)
        (gethash "result" (gethash "body" answer))
      (error "`%s': %s" expression (gethash "message" answer)))))

(defun session-expect (expression value)
  "Check that EXPRESSION has a VALUE."
  (let ((found (session-value expression)))
    (unless (string= found value)
      (error "`%s' is %s, not %s" expression found value))))

(find-file (expand-file-name "main.rchit" session-scene))
(goto-char (point-min))
(forward-line 13)
(dap-breakpoint-add)

(let ((template (copy-sequence (cdr (assoc "Debug a pixel" dap-debug-template-configurations)))))
  (setq template (plist-put template :scene (expand-file-name "scene.toml" session-scene)))
  (dap-debug (plist-put template :pixel [0 0])))

(session-stopped-at "main.rgen" 13)
(dap-next (dap--cur-session))
(session-stopped-at "main.rgen" 14)
(dap-continue (dap--cur-session) (dap--debug-session-thread-id (dap--cur-session)))
(session-stopped-at "main.rchit" 14)
(session-expect "axis" "(3, 0, 0)")
(session-expect "gl_HitLSSPositionsNV[1]" "(2, 0, 4)")
(dap-step-out (dap--cur-session))
(session-stopped-at "main.rgen" 16)
(dap-continue (dap--cur-session) (dap--debug-session-thread-id (dap--cur-session)))
(session-wait "the end" (lambda () (not (dap--session-running (dap--cur-session)))))

;;; session.el ends here
