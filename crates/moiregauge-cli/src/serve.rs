//! `moiregauge serve`: the page.

use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;
use std::process::ExitCode;

use moiregauge_pipeline::Job;
use moiregauge_serve::{Options, ServeError};

use crate::errors::advice;
use crate::say::say;

/// Open a page to look at scans, analyse them, correct by hand and map
///
/// Starts a server for this computer alone and opens a browser on it. Choose scans from the folders that are named, or
/// drop files on the page. Other files are never opened, and no network is needed. The address, with the token that
/// gives access, is printed when the page is ready. Ctrl-C ends the server.
#[derive(clap::Args, Clone, Debug)]
#[command(after_long_help = "\
Examples:
  moiregauge serve scans/                      choose among the scans of a folder and its subfolders
  moiregauge serve                             drop files on the page
  moiregauge serve scans/ --keep works/        works are there again after the next start
  moiregauge serve scans/ --port 8000 --no-browser

A server that other computers can reach needs a token of your own:
  openssl rand -hex 16 > token; chmod 600 token
  moiregauge serve scans/ --address 192.168.1.5 --port 8000 --token-file token --no-browser")]
pub(crate) struct ServeArgs {
    /// Folders whose scans may be opened, subfolders included
    #[arg(value_name = "FOLDER")]
    folders: Vec<PathBuf>,
    /// Port [default: one that is free]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Do not open a browser; open the printed address yourself
    #[arg(long)]
    no_browser: bool,
    /// Keep works (files, settings, measured scans) in this folder; without it nothing is saved when the server ends
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Serve the page from this folder instead of the one inside the program
    #[arg(long, value_name = "DIR")]
    page: Option<PathBuf>,
    /// Address to listen on; any address other computers can reach needs --token-file
    #[arg(long, value_name = "ADDR", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    address: IpAddr,
    /// File with the token, at least 32 letters and digits in its first line, that only its owner can read [default: a
    /// new token at every start]
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
}

/// Answers until Ctrl-C.
pub(crate) fn run(args: &ServeArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let options = Options {
        roots: args.folders.clone(),
        address: args.address,
        port: args.port,
        token_file: args.token_file.clone(),
        page: args.page.clone(),
        keep: args.keep.clone(),
        browser: !args.no_browser,
        advice,
        ..Options::default()
    };
    let mut told = Ok(());
    let served = moiregauge_serve::serve(&options, job.cancel(), &mut |address| {
        told = say(&format!("{address}\n"));
    });
    served.map_err(with_option)?;
    told?;
    Ok(ExitCode::SUCCESS)
}

/// The error with the option that it is about.
fn with_option(error: ServeError) -> anyhow::Error {
    let option = match &error {
        ServeError::NotAlone(_) => "--address needs --token-file",
        ServeError::Token { .. } => "--token-file",
        ServeError::Listen { .. } => "--port, --address",
        _ => return error.into(),
    };
    anyhow::Error::new(error).context(option)
}
