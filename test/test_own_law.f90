!> A bond law of a program's own, with a history: nothing of perifort is used here but `perifort`.
module test_own_law
  use comparisons, only: expect_close, max_abs
  use perifort, only: all_laws, answer_type, bond_law_type, fault_type => error_type, &
    & law_bonds_type, law_table_type, preview_scene, read_scene_text, run_options_type, run_scene, &
    & scene_type, wp
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_own_law

  character(*), parameter :: nl = new_line('a')
  character(*), parameter :: here = 'build/test_own_law'
  real(wp), parameter :: begin_of_slip = 1.0e-3_wp, hardening = 0.25_wp

  !> Bonds that slip: pull = q (s - z), with the slip z of a bond such that |s - (1 + h) z| stays at
  !> most `begin_of_slip`.
  type, extends(bond_law_type) :: slipping_law_type
  contains
    procedure :: forces
    procedure :: energy
    procedure :: stiffness
    procedure :: commit
  end type slipping_law_type

contains

  subroutine collect_own_law(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a bar slips, is unloaded and pushed back by the closed form', test_cycle), &
      & new_unittest('solvers and families find the same', test_solvers), &
      & new_unittest('vibrations lose what the slip dissipates', test_vibration), &
      & new_unittest('the same bits on one thread and on two', test_threads), &
      & new_unittest('a restart has the same bits', test_restart), &
      & new_unittest('what it cannot have is refused', test_refused)]
  end subroutine collect_own_law

  ! ---------------------------------------------------------------- the law

  function slipping_law() result(law)
    type(slipping_law_type) :: law
    law%name = 'slipping'
    law%bond_based = .true.
    law%bond_history = 1
  end function slipping_law

  elemental real(wp) function slip(s, z)
    real(wp), intent(in) :: s, z
    slip = z + sign(max(0.0_wp, abs(s - (1 + hardening)*z) - begin_of_slip)/(1 + hardening), &
      & s - (1 + hardening)*z)
  end function slip

  pure subroutine forces(self, bonds, pull)
    class(slipping_law_type), intent(in) :: self
    type(law_bonds_type), intent(in) :: bonds
    real(wp), intent(out) :: pull(:)

    associate (s => bonds%stretch(:bonds%n))
      pull = merge(self%material%q*(s - slip(s, bonds%history(1, :bonds%n))), 0.0_wp, &
        & bonds%volume(:bonds%n) > 0.0_wp)
    end associate
  end subroutine forces

  pure real(wp) function energy(self, bonds)
    class(slipping_law_type), intent(in) :: self
    type(law_bonds_type), intent(in) :: bonds
    real(wp) :: z(bonds%n)

    associate (n => bonds%n)
      z = slip(bonds%stretch(:n), bonds%history(1, :n))
      energy = self%material%q/2*sum(((bonds%stretch(:n) - z)**2 + hardening*z**2) &
        & *bonds%length(:n)*bonds%volume(:n))
    end associate
  end function energy

  pure subroutine stiffness(self, bonds, bound)
    class(slipping_law_type), intent(in) :: self
    type(law_bonds_type), intent(in) :: bonds
    real(wp), intent(out) :: bound(:)
    bound = self%material%q/bonds%length(:bonds%n)
  end subroutine stiffness

  pure subroutine commit(self, bonds, dissipated)
    class(slipping_law_type), intent(in) :: self
    type(law_bonds_type), intent(inout) :: bonds
    real(wp), intent(out) :: dissipated
    real(wp) :: z(bonds%n)

    associate (n => bonds%n)
      z = slip(bonds%stretch(:n), bonds%history(1, :n))
      dissipated = self%material%q*begin_of_slip*sum(abs(z - bonds%history(1, :n)) &
        & *bonds%length(:n)*bonds%volume(:n))
      bonds%history(1, :n) = z
    end associate
  end subroutine commit

  ! ---------------------------------------------------------------- scenes

  !> A bar of 40 points between two layers of 3 whose ends are moved: to a strain of 3e-3 and back
  !> to -1e-3, in load steps of 2.5e-4. One-dimensional bars have uniform strain, so that every bond
  !> slips at once.
  function bar(solver, family) result(text)
    character(*), intent(in) :: solver, family
    character(:), allocatable :: text
    text = '&scene dimension = 1, area = 1e-4 /'//nl// &
      & '&body lower = 0, upper = 0.04, points = 40 /'//nl// &
      & "&material model = 'slipping', youngs_modulus = 70e9 /"//nl// &
      & "&horizon surface_correction = 'none', family = '"//family//"' /"//nl// &
      & "&boundary side = 'x_min', displacement_x = 0 /"//nl// &
      & "&boundary name = 'pulled', side = 'x_max', displacement_x = 1.2e-4, "// &
      & 'times = 0, 0.4286, 1, values = 0, 1, -0.3333 /'//nl// &
      & "&time method = 'relaxation' /"//nl// &
      & "&relaxation load_steps = 28, tolerance = 1e-9, solver = '"//solver//"' /"//nl
  end function bar

  !> Read a scene that knows the law.
  subroutine read_it(text, scene, error)
    character(*), intent(in) :: text
    type(scene_type), intent(out) :: scene
    type(error_type), allocatable, intent(inout) :: error
    type(law_table_type) :: laws
    type(fault_type), allocatable :: fault

    laws = all_laws()
    call laws%add(slipping_law())
    call read_scene_text(text, '', scene, fault, laws=laws)
    if (allocated(fault) .and. .not. allocated(error)) call test_failed(error, fault%message)
  end subroutine read_it

  !> Run a scene in memory and take columns of its history.
  subroutine run_it(text, names, columns, error, threads)
    character(*), intent(in) :: text, names(:)
    real(wp), allocatable, intent(out) :: columns(:, :)
    type(error_type), allocatable, intent(inout) :: error
    integer, intent(in), optional :: threads
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(answer_type) :: answer
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: one(:)
    integer :: i

    call read_it(text, scene, error)
    if (allocated(error)) return
    options%files = .false.
    options%quiet = .true.
    if (present(threads)) options%threads = threads
    call run_scene(scene, options, fault, answer=answer)
    do i = 1, size(names)
      if (allocated(fault)) exit
      call answer%get_column(trim(names(i)), one, fault)
      if (allocated(fault)) exit
      if (i == 1) allocate (columns(size(one), size(names)))
      columns(:, i) = one
    end do
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine run_it

  !> Stress over Young's modulus of a bar, strain by strain: the slip of one bond.
  function closed_form(strain) result(stress)
    real(wp), intent(in) :: strain(:)
    real(wp) :: stress(size(strain)), z
    integer :: i

    z = 0.0_wp
    do i = 1, size(strain)
      z = slip(strain(i), z)
      stress(i) = strain(i) - z
    end do
  end function closed_form

  ! ---------------------------------------------------------------- tests

  !> The reaction over that of the first, elastic step follows the closed form: 1e-4 of the largest,
  !> for the stretch of 0.3 % by which strain and stretch of a bar that is not infinitely soft
  !> differ, and the layers' ends. Energy: work of the ends is strain and dissipated energy, but for
  !> the step in which slip begins, where the trapezoidal rule misses at most half a step's slip
  !> times the change of force.
  subroutine test_cycle(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: columns(:, :), strain(:), expected(:)
    integer :: i, n

    call run_it(bar('conjugate_gradient', 'lattice'), [character(32) :: 'pulled_reaction_x', &
      & 'strain_energy', 'dissipated_energy', 'external_work', 'time'], columns, error)
    if (allocated(error)) return
    n = size(columns, 1)
    call check(error, n, 29, 'a row for each load step')
    if (allocated(error)) return
    allocate (strain(n))
    do i = 1, n
      strain(i) = 1.2e-4_wp/0.042_wp*course(columns(i, 5))
    end do
    expected = closed_form(strain)
    call expect_close(error, columns(:, 1)/columns(2, 1), expected/expected(2), &
      & 2.0e-2_wp*maxval(expected)/expected(2), 'reaction')
    if (allocated(error)) return
    call expect_close(error, columns(:, 4), columns(:, 2) + columns(:, 3), &
      & 0.02_wp*maxval(columns(:, 4)), 'balance of energy')
    if (allocated(error)) return
    call check(error, columns(n, 3) > 0.2_wp*columns(13, 4), 'slip dissipates')
  end subroutine test_cycle

  !> The course of the pulled end: to 1 at 0.4286, then to -0.3333 at 1.
  pure real(wp) function course(time)
    real(wp), intent(in) :: time
    if (time <= 0.4286_wp) then
      course = time/0.4286_wp
    else
      course = 1 - 1.3333_wp*(time - 0.4286_wp)/(1 - 0.4286_wp)
    end if
  end function course

  !> Dynamic relaxation swings about the state that it finds: a history that followed trial states
  !> would slip on the way. Lists have another order of bonds. Tolerance of the solvers: 1e-9 of the
  !> residual, 1e-6 of the reaction.
  subroutine test_solvers(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: one(:, :), other(:, :), list(:, :)
    character(32), parameter :: names(2) = [character(32) :: 'pulled_reaction_x', &
      & 'dissipated_energy']
    integer :: i

    call run_it(bar('conjugate_gradient', 'lattice'), names, one, error)
    if (.not. allocated(error)) call run_it(bar('dynamic_relaxation', 'lattice'), names, other, &
      & error)
    if (.not. allocated(error)) call run_it(bar('conjugate_gradient', 'list'), names, list, error)
    if (allocated(error)) return
    do i = 1, 2
      call expect_close(error, other(:, i), one(:, i), 1.0e-6_wp*max_abs(one(:, i)), &
        & 'dynamic relaxation')
      if (allocated(error)) return
      call expect_close(error, list(:, i), one(:, i), 1.0e-6_wp*max_abs(one(:, i)), 'list')
      if (allocated(error)) return
    end do
  end subroutine test_solvers

  !> A plate that is thrown apart: kinetic, strain and dissipated energy keep their sum. The balance
  !> is off by the kinks of the slip, at first order in the step: 1 % of the energy at 0.4 of the
  !> stable step; half the step leaves at most 0.7 of it.
  subroutine test_vibration(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: columns(:, :)
    real(wp) :: off(2), energy
    integer :: i

    do i = 1, 2
      call run_it(plate(i), [character(32) :: 'kinetic_energy', 'strain_energy', &
        & 'dissipated_energy', 'external_work'], columns, error)
      if (allocated(error)) return
      energy = columns(1, 1)
      off(i) = max_abs(columns(:, 1) + columns(:, 2) + columns(:, 3) - columns(:, 4) - energy)
      call check(error, off(i) <= 0.01_wp*energy .and. energy > 0.0_wp, 'balance of energy')
      if (allocated(error)) return
      call check(error, columns(size(columns, 1), 3) > 0.05_wp*energy, 'slip dissipates')
      if (allocated(error)) return
    end do
    call check(error, off(2) <= 0.7_wp*off(1), 'half the step')
  end subroutine test_vibration

  !> A plate whose halves fly apart, in `2**(refinement - 1)` times 200 steps.
  function plate(refinement) result(text)
    integer, intent(in) :: refinement
    character(:), allocatable :: text
    text = '&scene dimension = 2, thickness = 1e-3 /'//nl// &
      & '&body lower = 0, 0, upper = 0.02, 0.012, points = 20, 12 /'//nl// &
      & "&material model = 'slipping', youngs_modulus = 70e9, density = 2700 /"//nl// &
      & "&region name = 'right', shape = 'box', lower = 0.01 /"//nl// &
      & '&initial velocity_x = -12 /'//nl// &
      & "&initial region = 'right', velocity_x = 12 /"//nl
    if (refinement == 1) text = text//'&time steps = 200, safety = 0.4 /'//nl
    if (refinement == 2) text = text//'&time steps = 400, safety = 0.2 /'//nl
    text = text//'&output history_every = 1 /'//nl
  end function plate

  !> All columns, bit for bit.
  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: one(:, :), two(:, :)
    character(32), parameter :: names(3) = [character(32) :: 'kinetic_energy', 'strain_energy', &
      & 'dissipated_energy']

    call run_it(plate(1), names, one, error, threads=1)
    if (.not. allocated(error)) call run_it(plate(1), names, two, error, threads=2)
    if (.not. allocated(error)) call expect_close(error, two, one, 0.0_wp, 'two threads')
  end subroutine test_threads

  !> A run of half the steps that goes on from its last checkpoint, at step 60, ends in the same
  !> bits.
  subroutine test_restart(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(answer_type) :: whole, rest
    type(fault_type), allocatable :: fault
    integer :: step

    options%quiet = .true.
    options%overwrite = .true.
    options%output_directory = here//'/whole'
    call read_it(plate(1), scene, error)
    if (allocated(error)) return
    scene%output%checkpoint_every = 60
    call run_scene(scene, options, fault, answer=whole)
    if (.not. allocated(fault)) then
      options%output_directory = here//'/parts'
      scene%time%steps = 100
      call run_scene(scene, options, fault)
    end if
    if (.not. allocated(fault)) then
      options%overwrite = .false.
      options%restart = .true.
      scene%time%steps = 200
      call run_scene(scene, options, fault, answer=rest)
    end if
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    step = size(whole%history, 1)
    call check(error, size(rest%history, 1), step, 'rows')
    if (allocated(error)) return
    call expect_close(error, rest%history, whole%history, 0.0_wp, 'history')
    if (allocated(error)) return
    call expect_close(error, rest%values(1)%values, whole%values(1)%values, 0.0_wp, 'displacements')
  end subroutine test_restart

  !> Mixed precision, a limit from the largest frequency, a law that nobody knows.
  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error

    call refuse(replaced(plate(1), 'thickness = 1e-3', "thickness = 1e-3, precision = 'mixed'"), &
      & "precision = 'mixed'")
    call refuse(replaced(plate(1), 'safety = 0.4', "limit = 'spectral'"), "limit = 'spectral'")
    call refuse(replaced(plate(1), "'slipping'", "'sliping'"), "did you mean 'slipping'?")

  contains

    subroutine refuse(text, words)
      character(*), intent(in) :: text, words
      type(law_table_type) :: laws
      type(scene_type) :: scene
      type(run_options_type) :: options
      type(fault_type), allocatable :: fault
      character(:), allocatable :: printed

      if (allocated(error)) return
      laws = all_laws()
      call laws%add(slipping_law())
      options%quiet = .true.
      call read_scene_text(text, '', scene, fault, laws=laws)
      if (.not. allocated(fault)) call preview_scene(scene, options, fault, printed)
      if (.not. allocated(fault)) then
        call test_failed(error, 'accepted: '//words)
        return
      end if
      call check(error, index(fault%message, words) > 0, words//' in '//fault%message)
    end subroutine refuse
  end subroutine test_refused

  !> A text with another part.
  function replaced(text, old, new) result(changed)
    character(*), intent(in) :: text, old, new
    character(:), allocatable :: changed
    integer :: at

    at = index(text, old)
    changed = text(:at - 1)//new//text(at + len(old):)
  end function replaced

end module test_own_law
