-- A session of nvim-dap with `anyhit dap`: Neovim itself debugs a pixel, with the configuration that
-- docs/debugging.md shows. `.ci/judge-editors` runs it, with nvim-dap in the folder NVIM_DAP and the program
-- in ANYHIT; without nvim-dap, only the file types are checked:
--
--   nvim --headless --clean -l editors/neovim/session.lua
--
-- The scene's facts are those of ../emacs/session.el.

local root = vim.fs.dirname(vim.fs.dirname(vim.fs.dirname(vim.fn.fnamemodify(debug.getinfo(1).source:sub(2), ":p"))))
local scene = root .. "/shaders/pass/debugger/swept-spheres/"

-- The snippet starts a program of this name.
vim.env.PATH = vim.fs.dirname(vim.env.ANYHIT) .. ":" .. vim.env.PATH
if vim.env.NVIM_DAP then
  vim.opt.runtimepath:append(vim.env.NVIM_DAP)
else
  package.preload.dap = function() return { adapters = {}, configurations = {} } end
end
vim.cmd.cd(root)

local page = table.concat(vim.fn.readfile(root .. "/docs/debugging.md"), "\n")
assert(load(assert(page:match("```lua\n(.-)\n```"))))()
local dap = require("dap")

-- Each kind of source gets a file type that has a configuration.
local extensions = { "rgen", "rint", "rahit", "rchit", "rmiss", "rcall", "comp", "glsl", "slang", "hlsl", "wgsl" }
for _, extension in ipairs(extensions) do
  local filetype = vim.filetype.match({ filename = "main." .. extension })
  assert(filetype and dap.configurations[filetype], extension .. ": no configuration of the file type " .. tostring(filetype))
end

if not vim.env.NVIM_DAP then
  print("SKIPPED: editors: a session of Neovim: NVIM_DAP names no folder of nvim-dap\n")
  os.exit(0)
end

local function wait(what, condition)
  if not vim.wait(60000, condition, 20) then
    error("it did not come to this: " .. what)
  end
  print(what .. "\n")
end

local function stopped_at(file, line)
  wait(("stopped at %s:%d"):format(file, line), function()
    local frame = dap.session() and dap.session().stopped_thread_id and dap.session().current_frame
    return frame and frame.line == line and vim.fs.basename(frame.source.path) == file
  end)
end

local function expect(expression, value)
  local answer
  local arguments = { expression = expression, frameId = dap.session().current_frame.id, context = "watch" }
  dap.session():request("evaluate", arguments, function(failure, body)
    answer = failure and failure.message or body.result
  end)
  wait(expression, function() return answer end)
  assert(answer == value, ("`%s` is %s, not %s"):format(expression, answer, value))
end

vim.cmd.edit(scene .. "main.rchit")
vim.api.nvim_win_set_cursor(0, { 14, 0 })
dap.set_breakpoint()

local configuration = vim.deepcopy(dap.configurations.glsl[1])
configuration.scene = scene .. "scene.toml"
configuration.pixel = { 0, 0 }
dap.run(configuration)

stopped_at("main.rgen", 13)
dap.step_over()
stopped_at("main.rgen", 14)
dap.continue()
stopped_at("main.rchit", 14)
expect("axis", "(3, 0, 0)")
expect("gl_HitLSSPositionsNV[1]", "(2, 0, 4)")
dap.step_out()
stopped_at("main.rgen", 16)
dap.continue()
wait("the end", function() return dap.session() == nil end)
