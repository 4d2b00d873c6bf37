# Start-up file of ./irsbot shell: that of the user, then the environment, which it may have overwritten.
# shellcheck shell=bash disable=SC1090
[[ -f ~/.bashrc ]] && source ~/.bashrc
eval "$IRSBOT_EXPORTS"
unset IRSBOT_EXPORTS
PS1="(irsbot) ${PS1:-\\$ }"
